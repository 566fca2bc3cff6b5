// SPDX-License-Identifier: Apache-2.0
// Points on a card, and a pipeline that computes elsewhere: an error that says what to do, and nothing is lost.
#include <gtest/gtest.h>

#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

TEST(DevicePoints, of_a_card_are_refused_by_a_pipeline_on_the_cpu) {
  float place[3] = {};
  Pipeline pipeline(Device::cpu);
  expect_error(ErrorKind::usage, "computes on the CPU", [&] { pipeline.load(DevicePoints{place, 1}, {}); });
}

TEST(DevicePoints, an_output_on_a_card_is_refused_by_a_pipeline_on_the_cpu_which_keeps_its_cloud) {
  const std::vector<Point> points = shapes::sphere(500);
  std::vector<float> place(3 * points.size());
  Params params{.k = 8};
  Pipeline pipeline = loaded(points);
  const DeviceOutput out{place.data(), points.size()};
  expect_error(ErrorKind::usage, "make it with Device::cuda", [&] { pipeline.run(params, out, {}); });
  std::vector<Point> result(points.size());
  pipeline.run(params, result);
  expect_error(ErrorKind::usage, "computes on the CPU", [&] { pipeline.normals(out, {}); });
  const std::vector<Point> expected = Ran(points, params).points;
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(result[i].x, expected[i].x);
}

TEST(DevicePoints, an_output_of_another_size_is_refused_first) {
  Pipeline pipeline = loaded(shapes::sphere(500));
  expect_error(ErrorKind::usage, "holds 499 points", [&] { pipeline.run({}, DeviceOutput{nullptr, 499}, {}); });
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
