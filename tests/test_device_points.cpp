// SPDX-License-Identifier: Apache-2.0
// Points on a card, and a pipeline that computes elsewhere: an error that says what to do, and nothing is lost.
#include <gtest/gtest.h>

#include "pointfair/pointfair.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

template <class Call>
std::string usage_error_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::usage);
    return error.what();
  }
  return "";
}

TEST(DevicePoints, of_a_card_are_refused_by_a_pipeline_on_the_cpu) {
  float place[3] = {};
  Pipeline pipeline(Device::cpu);
  EXPECT_NE(usage_error_of([&] {
              pipeline.load(DevicePoints{place, 1}, {});
            }).find("computes on the CPU"),
            std::string::npos);
}

TEST(DevicePoints, an_output_on_a_card_is_refused_by_a_pipeline_on_the_cpu_which_keeps_its_cloud) {
  const std::vector<Point> points = shapes::sphere(500);
  std::vector<float> place(3 * points.size());
  Params params;
  params.k = 8;
  Pipeline pipeline(Device::cpu);
  pipeline.load(points);
  const DeviceOutput out{place.data(), points.size()};
  EXPECT_NE(usage_error_of([&] { pipeline.run(params, out, {}); }).find("make it with Device::cuda"),
            std::string::npos);
  std::vector<Point> expected(points.size()), result(points.size());
  pipeline.run(params, result);
  EXPECT_NE(usage_error_of([&] { pipeline.normals(out, {}); }).find("computes on the CPU"), std::string::npos);
  Pipeline other(Device::cpu);
  other.load(points);
  other.run(params, expected);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(result[i].x, expected[i].x);
}

TEST(DevicePoints, an_output_of_another_size_is_refused_first) {
  Pipeline pipeline(Device::cpu);
  pipeline.load(shapes::sphere(500));
  EXPECT_NE(usage_error_of([&] {
              pipeline.run({}, DeviceOutput{nullptr, 499}, {});
            }).find("holds 499 points"),
            std::string::npos);
}

// The sample of few positions is all of them.
TEST(DevicePoints, have_the_origin_of_arrays) {
  for (const double offset : {0.0, 4.5e6}) {
    std::vector<Position> positions;
    for (const Point& p : shapes::sphere(3000)) positions.push_back({offset + p.x, offset / 10 + p.y, double(p.z)});
    EXPECT_EQ(choose_origin_by_sample(positions), choose_origin(positions));
  }
}

}  // namespace
}  // namespace pointfair
