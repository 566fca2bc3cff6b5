// SPDX-License-Identifier: Apache-2.0
// The place of the sensor that the distances between points show.
#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "backend_runs.h"
#include "board_scan.h"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using reference::Vec, reference::length;
using shapes::Points;

TEST(FoundSensor, shows_the_mixed_pixels_that_its_true_place_shows) {
  const Scan cloud = scan();
  const Ran told = run(cloud.points, {&kSensor, 1}, marking());
  EXPECT_FALSE(told.report.found_sensor.has_value());
  const Ran found = run(cloud.points, {}, marking());
  const Shares its = shares(cloud, found.outliers);
  EXPECT_GT(its.found, 0.8);
  EXPECT_LT(its.wrong, 0.001);
  ASSERT_TRUE(found.report.found_sensor.has_value());
  const Position place = *found.report.found_sensor;
  EXPECT_LT(length(Vec{place[0] - kSensor[0], place[1] - kSensor[1], place[2] - kSensor[2]}), 0.3 * 3.0);
}

TEST(FoundSensor, depends_on_the_set_of_points_alone) {
  const Scan cloud = scan();
  const std::vector<std::uint32_t> order = shapes::shuffle_order(cloud.points.size(), 9);
  const Ran in_order = run(cloud.points, {}), shuffled = Ran(shapes::permuted(cloud.points, order), {}, 3);
  EXPECT_EQ(difference(shapes::permuted(in_order.points, order), shuffled.points), "");
  EXPECT_EQ(in_order.report.found_sensor, shuffled.report.found_sensor);
  const Ran moved = run(shapes::shifted(cloud.points, {64, -32, 16}), {});
  EXPECT_GT(moved.report.unmoved.outliers_by_reason.mixed_pixels, 100u);
}

// What was measured for another run changes no result: neither lists nor typed lengths look for a sensor.
TEST(FoundSensor, is_taken_only_where_a_run_within_a_radius_measures_the_noise) {
  const Scan cloud = scan();
  const Params typed = loaded(cloud.points).resolve({});
  for (const Params& params : {Params{.k = 12}, typed}) {
    Pipeline pipeline = loaded(cloud.points);
    Points first(cloud.points.size()), again(first.size());
    pipeline.run(params, first);
    EXPECT_FALSE(pipeline.report().found_sensor.has_value());
    pipeline.run({}, again);
    EXPECT_TRUE(pipeline.report().found_sensor.has_value());
    pipeline.run(params, again);
    EXPECT_FALSE(pipeline.report().found_sensor.has_value());
    EXPECT_EQ(difference(first, again), "");
  }
}

// From two places that see one scene, and by no sensor at all: even, uneven, of steps, few.
TEST(FoundSensor, is_none_where_no_one_place_explains_the_distances) {
  Points two = scan().points;
  for (const Point& p : scan().points) two.push_back({p.x, 6.3f - p.y, p.z});  // a sensor behind the wall
  const std::pair<const char*, Points> clouds[] = {{"two sensors", std::move(two)},
                                                   {"plane", shapes::with_noise(shapes::plane(20000), 0.002)},
                                                   {"sphere", shapes::with_noise(shapes::sphere(20000), 0.01)},
                                                   {"cube", shapes::with_noise(shapes::cube(20000), 0.004)},
                                                   {"waves", shapes::with_noise(shapes::waves(20000), 0.002)},
                                                   {"sheets", shapes::two_sheets(10000, 0.05)},
                                                   {"grid", shapes::grid(100)},
                                                   {"few", shapes::with_noise(shapes::sphere(60), 0.01)}};
  for (const auto& [name, points] : clouds) EXPECT_FALSE(run(points, {}).report.found_sensor.has_value()) << name;
}

}  // namespace
}  // namespace pointfair
