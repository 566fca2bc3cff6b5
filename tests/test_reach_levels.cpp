// SPDX-License-Identifier: Apache-2.0
// How wide neighbourhoods are from place to place.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

constexpr int kPoints = 40000;  // over the unit square
constexpr double kSpacing = 0.005, kNoise = 0.15 * kSpacing;

double height_of_waves(double x, double y) {
  const double wave = 2 * 3.141592653589793 / (7 * kSpacing);
  return 0.5 * kSpacing * std::sin(wave * x) * std::sin(wave * y);
}

// A plane whose right half has waves of seven spacings.
double height(double x, double y) { return x < 0.5 ? 0 : height_of_waves(x, y); }
Points half_rough() { return shapes::with_noise(shapes::lifted(shapes::plane(kPoints), height), kNoise); }

struct Outcome : Ran {
  explicit Outcome(const Points& cloud, const Params& params = {})
      : Ran(cloud, params), levels(PipelineAccess::followed_noise(pipeline).reach_levels) {}
  std::shared_ptr<const NodeLevels> levels;
};

double level_at(const Outcome& outcome, Point p) { return reference::level_at(outcome.levels.get(), p); }

TEST(ReachLevels, are_below_one_on_rough_ground_and_above_on_a_plane) {
  const Outcome outcome(half_rough());
  ASSERT_TRUE(outcome.levels);
  EXPECT_LT(level_at(outcome, {0.8f, 0.5f, 0}), 0.85);
  EXPECT_GT(level_at(outcome, {0.2f, 0.5f, 0}), 1.3);
}

// Distances to the surface are taken upright, which is alike for both.
TEST(ReachLevels, let_a_run_leave_less_on_either_than_one_width_everywhere) {
  const Points points = half_rough();
  const auto left = [](const Points& of, bool of_rough) {
    double sum = 0;
    for (const Point& p : of)
      if (std::abs(p.x - 0.5) > 0.1 && (p.x > 0.5) == of_rough) sum += std::abs(p.z - height(p.x, p.y));
    return sum;
  };
  const Points followed = Outcome(points).points, same = Outcome(points, {.min_neighbors = 16}).points;
  EXPECT_LT(left(followed, true), 0.97 * left(same, true));
  EXPECT_LT(left(followed, false), 0.9 * left(same, false));
}

// Where eight points leave least error, a second iteration and the filter of the normals harm.
TEST(ReachLevels, keep_rough_ground_from_being_averaged_on) {
  const Points points = half_rough();
  const auto left = [](const Points& of) {
    double sum = 0;
    for (const Point& p : of)
      if (p.x > 0.6) sum += std::abs(p.z - height(p.x, p.y));
    return sum;
  };
  EXPECT_LT(left(Outcome(points).points),
            1.15 * left(Outcome(points, {.normal_filter = NormalFilter::off, .iterations = 1}).points));
}

TEST(ReachLevels, are_followed_where_the_number_of_neighbors_is_automatic_only) {
  Params params{.min_neighbors = 16};
  EXPECT_FALSE(Outcome(half_rough(), params).levels);
  params = {};
  params.method = Method::mls;
  EXPECT_FALSE(Outcome(half_rough(), params).levels);
}

// Six points of one line of a scanner tell no plane.
TEST(ReachLevels, do_not_shrink_to_single_lines_of_a_scanner) {
  Points points;
  for (int line = 0; line < 100; ++line)
    for (int i = 0; i < 1000; ++i)
      points.push_back({float(i) / 1000, float(line) / 100, float(0.02 * std::sin(60.0 * line / 100))});
  points = shapes::with_noise(points, 0.0005);
  const Outcome outcome(points);
  ASSERT_TRUE(outcome.levels);
  for (const float level : outcome.levels->levels) ASSERT_GE(level, 0.99f);
}

// Profiles of a scanner that is driven past, farther apart than the sixteen nearest points of a profile reach.
TEST(Neighbourhoods, reach_the_next_profile_however_far_apart_profiles_are) {
  for (const int spacings : {4, 12, 20, 30}) {
    constexpr double kAlong = 0.005, kSigma = 0.6 * kAlong;
    const auto height = [](double x, double y) { return 0.05 * std::sin(3 * x) + 0.03 * y; };
    shapes::Random random(11);
    Points points;
    for (int profile = 0; profile < 30; ++profile)
      for (int i = 0; i < 1000; ++i) {
        const double x = kAlong * (i + 0.1 * random.normal()),
                     y = kAlong * (spacings * profile + 0.2 * random.normal());
        points.push_back(shapes::make_point(x, y, height(x, y) + kSigma * random.normal()));
      }
    const auto off = [&](Point p) { return p.z - height(p.x, p.y); };
    EXPECT_LT(shapes::rms(Outcome(points).points, off), 0.35 * kSigma) << spacings;
  }
}

TEST(ReachLevels, are_above_one_on_a_plane_where_noise_is_nearly_the_spacing) {
  const Points points = shapes::with_noise(shapes::plane(kPoints), 0.7 * kSpacing);
  const Outcome followed(points);
  ASSERT_TRUE(followed.levels);
  EXPECT_GT(level_at(followed, {0.5f, 0.5f, 0}), 1.2);
  const auto left = [](const Points& of) { return shapes::mean_error(of, [](Point p) { return p.z; }); };
  EXPECT_LT(left(followed.points), 0.9 * left(Outcome(points, {.min_neighbors = 16}).points));
}

TEST(ReachLevels, are_not_below_one_where_the_noise_sets_the_radius) {
  const Outcome outcome(shapes::with_noise(shapes::plane(kPoints), 1.2 * kSpacing));
  ASSERT_TRUE(outcome.levels);
  for (const float level : outcome.levels->levels) ASSERT_GE(level, 0.98);
}

// Every sixteenth point shows that there is no shape.
TEST(ReachLevels, are_above_one_on_a_plane_with_noise_of_spacings) {
  const Outcome outcome(shapes::with_noise(shapes::plane(kPoints), 2.25 * kSpacing));
  ASSERT_TRUE(outcome.levels);
  for (const float x : {0.2f, 0.5f, 0.8f})
    for (const float y : {0.2f, 0.5f, 0.8f}) EXPECT_GT(level_at(outcome, {x, y, 0}), 1.2);
}

}  // namespace
}  // namespace pointfair
