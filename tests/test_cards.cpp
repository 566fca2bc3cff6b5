// SPDX-License-Identifier: Apache-2.0
// Clouds that several cards share give the bits of one device. Here the CPU stands for each card, and where there are
// cards, they do.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "backend_runs.h"
#include "forwarding_backend.h"
#include "meshes.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "shapes.h"
#include "sharing_backend.h"
#include "slow_tools.h"
#include "tiles/feeders.hpp"

namespace pointfair {
namespace {

using shapes::Points;

Points cloud(int count) { return shapes::with_noise(shapes::sphere(count), 0.002); }

// Counts what it is given to compute.
class CountingBackend : public ForwardingBackend {
 public:
  explicit CountingBackend(std::atomic<int>& runs) : ForwardingBackend(make_cpu_backend(0)), runs_(runs) {}
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override {
    ++runs_;
    ForwardingBackend::fair(iteration, settings, stop);
  }

 private:
  std::atomic<int>& runs_;
};

// A card as it is: no run reads faces on it.
class FacelessBackend : public ForwardingBackend {
 public:
  FacelessBackend() : ForwardingBackend(make_cpu_backend(0)) {}
  bool reads_faces() const override { return false; }
};

Pipeline over(std::vector<MakeBackend> cards, std::uint64_t worth_dividing) {
  auto first = cards[0]();
  return PipelineAccess::make(std::move(first), {Device::cpu, "cards", "test"},
                              MakeWorkers{std::move(cards), worth_dividing});
}

void expect_the_bits_of_one(Pipeline& shared, const Points& points, const Params& params, std::uint64_t least_tiles) {
  Pipeline one(Device::cpu);
  Points expected(points.size()), out(points.size());
  one.run(points, params, expected);
  shared.run(points, params, out);
  EXPECT_EQ(difference(expected, out), "");
  EXPECT_GE(shared.report().tiles, least_tiles);
  EXPECT_EQ(one.report().unmoved, shared.report().unmoved);
  EXPECT_EQ(one.report().params, shared.report().params);
  EXPECT_EQ(one.estimates().noise, shared.estimates().noise);
  EXPECT_EQ(one.estimates().spacing, shared.estimates().spacing);
  one.normals(expected);
  shared.normals(out);
  EXPECT_EQ(difference(expected, out), "");
}

TEST(Cards, share_a_cloud_with_the_bits_of_one_device) {
  std::atomic<int> runs[2]{};
  const auto card = [&](int number) { return [&, number] { return std::make_unique<CountingBackend>(runs[number]); }; };
  Pipeline shared = over({card(0), card(1)}, 10000);
  const Points points = cloud(60000);
  expect_the_bits_of_one(shared, points, {}, 4);
  EXPECT_GT(runs[0], 0);
  EXPECT_GT(runs[1], 0) << "the second card had nothing to do";
  for (const double rounding : {0.0, 1e-6})
    expect_the_bits_of_one(shared, shapes::repeated(cloud(15000), 4, rounding), {.outliers = Outliers::mark}, 4);
  Params params{.k = 8};
  expect_the_bits_of_one(shared, shapes::with_invalid(cloud(40000), 9), params, 4);
  params.outliers = Outliers::mark;
  params.iterations = 3;
  expect_the_bits_of_one(shared, shapes::with_stray(cloud(30000), 100), params, 4);
  expect_the_bits_of_one(shared, cloud(5000), {}, 1);
  EXPECT_EQ(shared.report().tiles, 1u) << "a small cloud is not divided";
  expect_the_bits_of_one(shared, points, params, 4);
}

// On `card`, which must not do it: on the CPU where it may go there, until another cloud is loaded.
void expect_a_run_on_the_cpu(const MakeBackend& card, const meshes::Mesh& mesh, const Params& params) {
  Points expected(mesh.points.size()), out = expected;
  const auto load = [&](Pipeline& pipeline) {
    pipeline.load(mesh.points);
    if (!mesh.faces.empty()) pipeline.set_faces(meshes::polygons_of(mesh.faces));
  };
  Pipeline one(Device::cpu);
  load(one);
  one.run(params, expected);

  MakeWorkers workers{{card}};
  Pipeline alone = PipelineAccess::make(card(), {Device::cuda, "card", "test"}, workers);
  load(alone);
  expect_error(ErrorKind::usage, "add --device cpu", [&] { alone.run(params, out); });

  workers.on_cpu = [] { return make_cpu_backend(0); };
  Pipeline pipeline = PipelineAccess::make(card(), {Device::cuda, "card", "test"}, workers);
  load(pipeline);
  pipeline.run({}, out);
  EXPECT_EQ(pipeline.report().device.name, "card");
  for (int turn = 0; turn < 2; ++turn) {
    std::fill(out.begin(), out.end(), Point{});
    pipeline.run(params, out);
    EXPECT_EQ(difference(expected, out), "");
    EXPECT_EQ(pipeline.report().device.kind, Device::cpu);
    EXPECT_EQ(pipeline.report().device.reason, "a card cannot do this run");
    EXPECT_EQ(pipeline.report().tiles, 1u);
  }
  one.run({}, expected);
  pipeline.run({}, out);
  EXPECT_EQ(difference(expected, out), "");
  load(pipeline);
  pipeline.run({}, out);
  EXPECT_EQ(difference(expected, out), "");
  EXPECT_EQ(pipeline.report().device.name, "card");
}

TEST(Cards, leave_runs_that_read_faces_to_the_cpu) {
  const MakeBackend card = [] { return std::make_unique<FacelessBackend>(); };
  const meshes::Mesh mesh = meshes::sheet(20, meshes::Sides::quads);
  for (const Method method : {Method::fleishman, Method::jones, Method::implicit})
    expect_a_run_on_the_cpu(card, mesh, meshes::along_mesh(method));
}

TEST(Cards, leave_runs_that_need_a_whole_cloud_to_the_cpu_where_it_is_in_tiles) {
  const MakeBackend card = [] { return std::make_unique<SmallBackend>(20000); };
  Params params{.method = Method::implicit};
  meshes::Mesh mesh;
  mesh.points = cloud(30000);
  expect_a_run_on_the_cpu(card, mesh, params);
}

std::unique_ptr<Backend> sharing() { return std::make_unique<SharingBackend>(make_cpu_backend(0)); }

std::vector<Params> kinds_of_params() {
  return {{},
          {.k = 8, .iterations = 1},
          {.outliers = Outliers::mark, .iterations = 3},
          {.method = Method::mls},
          {.k = 12, .constraint = true},
          {.k = 10, .method = Method::taubin}};
}

TEST(Cards, share_a_cloud_that_lies_on_the_first_of_them) {
  Pipeline shared = over({sharing, sharing, sharing}, 10000);
  const std::vector<Points> clouds{cloud(30000), shapes::with_invalid(cloud(20000), 9),
                                   shapes::with_stray(cloud(15000), 100), shapes::repeated(cloud(6000), 3, 1e-6)};
  for (const Params& params : kinds_of_params())
    for (const Points& points : clouds) {
      SCOPED_TRACE(std::to_string(points.size()) + " points, " + std::to_string(int(params.method)));
      expect_the_bits_of_one(shared, points, params, 3);
      EXPECT_EQ(shared.report().tiles, 3u);
    }
  expect_the_bits_of_one(shared, cloud(5000), {}, 1);
  EXPECT_EQ(shared.report().tiles, 1u) << "a small cloud is not divided";
}

// Each point has a sensor of its own, and marks go with the points.
TEST(Cards, that_share_a_cloud_know_where_the_sensor_stood) {
  const Points points = cloud(20000);
  std::vector<Origin> places;
  for (const Point& p : points) places.push_back({3.0 * p.x, 3.0 * p.y, 3 + 0.01 * p.z});
  Params params{.along = Along::ray};
  Pipeline one(Device::cpu), shared = over({sharing, sharing}, 10000);
  std::vector<Points> out(2, Points(points.size()));
  std::size_t number = 0;
  for (Pipeline* pipeline : {&one, &shared}) {
    pipeline->load(points);
    pipeline->set_viewpoint(places);
    pipeline->run(params, out[number++]);
  }
  EXPECT_EQ(difference(out[0], out[1]), "");
  EXPECT_EQ(shared.report().tiles, 2u);
}

TEST(Cards, that_are_small_share_smaller_tiles) {
  class SmallSharing final : public SharingBackend {
   public:
    SmallSharing() : SharingBackend(make_cpu_backend(0)) {}
    void take(DeviceTiles& whole, std::size_t tile) override {
      if (static_cast<SharingBackend&>(whole).gathered(tile).size() > 9000) throw Error(ErrorKind::memory, "no room");
      SharingBackend::take(whole, tile);
    }
  };
  Params params{.k = 8};
  Pipeline shared = over({sharing, [] { return std::make_unique<SmallSharing>(); }}, 10000);
  expect_the_bits_of_one(shared, cloud(60000), params, 16);
}

TEST(Cards, that_fail_leave_the_cloud_as_it_was) {
  class Failing final : public SharingBackend {
   public:
    explicit Failing(int& calls) : SharingBackend(make_cpu_backend(0)), calls_(calls) {}
    void give(DeviceTiles& whole, std::size_t tile) override {
      if (calls_-- == 0) throw Error(ErrorKind::failed, "this call fails");
      SharingBackend::give(whole, tile);
    }

   private:
    int& calls_;
  };
  const Points points = cloud(20000), expected = Ran(points).points;
  Points out(points.size());
  for (int fails_after = 0; fails_after < 2; ++fails_after) {
    int calls = fails_after;
    Pipeline shared = over({sharing, [&] { return std::make_unique<Failing>(calls); }}, 10000);
    shared.load(points);
    EXPECT_THROW(shared.run({}, out), Error);
    shared.run({}, out);
    EXPECT_EQ(difference(expected, out), "");
  }
}

TEST(Cards, of_different_sizes_share_tiles_that_fit_into_the_smallest) {
  const auto of_room = [](std::size_t room) { return [room] { return std::make_unique<SmallBackend>(room); }; };
  Pipeline shared = over({of_room(150000), of_room(60000)}, ~std::uint64_t{0});
  expect_the_bits_of_one(shared, cloud(200000), {}, 16);
  Pipeline coarse = over({of_room(1000000), of_room(60000)}, 200000);
  expect_the_bits_of_one(coarse, cloud(200000), {}, 8);
}

TEST(Cards, have_names) {
  EXPECT_EQ(parse_device("auto").kind, Device::automatic);
  EXPECT_EQ(parse_device("cpu", 3).threads, 3u);
  EXPECT_EQ(parse_device("cuda:3").index, 3);
  EXPECT_TRUE(parse_device("cuda:3").cards.empty());
  EXPECT_EQ(parse_device("cuda:2,0,2").cards, (std::vector<int>{2, 0, 2}));
  EXPECT_EQ(parse_device("cuda:2,0").index, 2);
  EXPECT_EQ(parse_device("cuda:all").kind, Device::cuda);
  for (const char* name : {"", "gpu", "cuda:", "cuda:x", "cuda:-1", "cuda:0,", "cuda:,1", "cuda:0 1", "cuda:all,0"}) {
    SCOPED_TRACE(name);
    expect_error(ErrorKind::usage, "", [&] { parse_device(name); });
  }
}

// So many points, or fewer under slow tools, yet enough to be divided.
std::size_t most_shared(std::size_t count) { return std::min(count, 20 * slow_tools::most_points(count)); }

int usable_cards() {
  const auto all = list_cuda_devices();
  return int(std::count_if(all.begin(), all.end(), [](const DeviceStatus& card) { return card.usable; }));
}

TEST(Cards, of_this_machine_share_a_cloud) {
  const int usable = usable_cards();
  if (usable == 0) GTEST_SKIP() << "no card";
  const Points points = cloud(int(most_shared(1 << 21)));
  Params params{.k = 8};
  for (const int second : {0, usable - 1}) {
    Pipeline shared =
        over({[] { return make_cuda_backend(0); }, [=] { return make_cuda_backend(second); }}, points.size() / 2);
    expect_the_bits_of_one(shared, points, {}, 2);
    expect_the_bits_of_one(shared, points, params, 2);
  }
  Pipeline whole(parse_device("cuda:all"));
  expect_the_bits_of_one(whole, points, params, 1);
  EXPECT_EQ(whole.report().tiles, 1u) << "too few points to be worth it";
}

// A machine with one card has it three times.
TEST(Cards, of_this_machine_share_all_kinds_of_clouds) {
  const int usable = usable_cards();
  if (usable == 0) GTEST_SKIP() << "no card";
  std::vector<MakeBackend> cards;
  for (int card = 0; card < 3; ++card) cards.push_back([=] { return make_cuda_backend(card % usable); });
  const int most = int(most_shared(100000));
  Pipeline shared = over(cards, std::uint64_t(most / 10));
  const std::vector<Points> clouds{cloud(most), shapes::with_invalid(cloud(most / 10 * 3), 9),
                                   shapes::with_stray(cloud(most / 10 * 4), 100)};
  for (const Params& params : slow_tools::some_of(kinds_of_params()))
    for (const Points& points : clouds) {
      SCOPED_TRACE(std::to_string(points.size()) + " points, " + std::to_string(int(params.method)));
      expect_the_bits_of_one(shared, points, params, 3);
    }
}

TEST(TaskQueue, ends_when_tasks_that_tasks_led_to_are_done) {
  TaskQueue<int> queue;
  std::atomic<int> done = 0;
  for (int i = 0; i < 4; ++i) queue.put(6);
  on_feeders(3, [&](std::size_t) {
    while (const auto task = queue.take(true)) {
      for (int more = 0; more < *task; ++more) queue.put(*task - 1 - more);
      ++done;
      queue.finish_one();
    }
  });
  EXPECT_EQ(done, 4 * 64) << "a task of n leads to 2^n in all";
}

TEST(TaskQueue, that_is_closed_lets_everybody_go_and_the_first_error_is_thrown) {
  TaskQueue<int> queue;
  queue.put(1);
  expect_error(ErrorKind::device, "lost", [&] {
    on_feeders(3, [&](std::size_t) {
      if (!queue.take(true)) return;
      queue.close();
      throw Error(ErrorKind::device, "lost");
    });
  });
}

}  // namespace
}  // namespace pointfair
