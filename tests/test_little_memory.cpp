// SPDX-License-Identifier: Apache-2.0
// Clouds that a device's memory does not hold, and devices that are lost.
#include <gtest/gtest.h>

#include <algorithm>

#include "backend_runs.h"
#include "forwarding_backend.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

Points cloud(int count) { return shapes::with_noise(shapes::sphere(count), 0.002); }

// A CPU backend with room for so many points.
class SmallBackend : public ForwardingBackend {
 public:
  explicit SmallBackend(std::size_t room) : ForwardingBackend(make_cpu_backend(0)), room_(room) {}
  void upload(std::span<const Point> points, IndexOrder expected) override {
    require(points.size() / 2);  // they fit, but not what is made of them
    count_ = points.size();
    ForwardingBackend::upload(points, expected);
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override {
    require(count_);
    ForwardingBackend::find_neighbors(iteration, settings, stop);
  }

 private:
  void require(std::size_t points) const {
    if (points > room_) throw Error(ErrorKind::memory, "no room");
  }
  std::size_t room_, count_ = 0;
};

// A pipeline whose device has too little memory against one whose has enough. `small` makes the former's backends.
void expect_the_same_in_little_memory(Device::Kind kind, const std::function<std::unique_ptr<Backend>()>& small) {
  const Points points = cloud(200000);
  Pipeline tight = PipelineAccess::make(small(), {kind, "small", "test"}, MakeWorkers{{small}}), ample(kind);
  Params params;
  for (int run = 0; run < 3; ++run) {
    if (run == 0) {  // nothing set: radius neighbourhoods
      tight.load(points);
      ample.load(points);
    } else if (run == 1) {
      params.k = 8;
    } else {  // some stages only
      params.similarity_sigma = 0.004;
    }
    Points expected(points.size()), out(points.size());
    ample.run(params, expected);
    tight.run(params, out);
    EXPECT_GT(tight.report().tiles, 1u);
    EXPECT_EQ(ample.report().tiles, 1u);
    EXPECT_EQ(ample.report().params, tight.report().params);
    EXPECT_EQ(difference(expected, out), "");
    EXPECT_EQ(ample.estimates().noise, tight.estimates().noise);
    tight.normals(out);
    ample.normals(expected);
    EXPECT_EQ(difference(expected, out), "");
  }
  result_of(tight, cloud(1000), params);
  EXPECT_EQ(tight.report().tiles, 1u) << "a cloud that fits";
}

TEST(LittleMemory, is_what_becomes_of_a_cloud_that_memory_does_not_hold) {
  for (const std::size_t room : {150000, 60000})
    expect_the_same_in_little_memory(Device::cpu, [room] { return std::make_unique<SmallBackend>(room); });
  const auto cards = list_cuda_devices();
  if (std::none_of(cards.begin(), cards.end(), [](const DeviceStatus& card) { return card.usable; })) return;
  // the second holds the points, but not their index; with 8 MB tiles of 3,000 points and what lies around them do not
  // fit
  for (const std::uint64_t bytes : {18'000'000, 10'000'000})
    expect_the_same_in_little_memory(Device::cuda, [bytes] { return make_cuda_backend(0, {.memory = bytes}); });
}

TEST(LittleMemory, that_never_fits_is_an_error) {
  const auto small = [] { return std::make_unique<SmallBackend>(100); };
  Pipeline pipeline = PipelineAccess::make(small(), {Device::cpu, "small", "test"}, MakeWorkers{{small}});
  expect_error(ErrorKind::memory, "", [&] {
    pipeline.load(cloud(100000));
    pipeline.run();
  });
}

// No more workers are to be had: the cloud is lost, and said to be; the next load is as any.
TEST(LittleMemory, without_workers_is_an_error_and_the_next_cloud_is_sound) {
  bool lost = true;
  const auto small = [&lost] {
    if (lost) throw Error(ErrorKind::device, "the card is lost");
    return std::make_unique<SmallBackend>(60000);
  };
  const Points points = cloud(100000), few = cloud(5000);
  Pipeline pipeline =
      PipelineAccess::make(std::make_unique<SmallBackend>(60000), {Device::cpu, "small", "test"}, MakeWorkers{{small}});
  pipeline.load(points);
  Points out(points.size());
  expect_error(ErrorKind::device, "", [&] { pipeline.run({}, out); });  // it is to be cut
  expect_error(ErrorKind::device, "", [&] { pipeline.run({}, out); });  // there is still no device
  expect_error(ErrorKind::device, "", [&] { pipeline.load(few); });
  lost = false;
  expect_error(ErrorKind::usage, "", [&] { pipeline.run({}, out); });  // no cloud is loaded
  EXPECT_EQ(pipeline.run().points.size(), 0u);
  EXPECT_EQ(pipeline.estimates().points, 0u) << "of the cloud that was lost";
  for (const Points& next : {few, points}) EXPECT_EQ(difference(result_of(pipeline, next), Ran(next).points), "");
}

}  // namespace
}  // namespace pointfair
