// SPDX-License-Identifier: Apache-2.0
// The noise from place to place, and what follows it.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "every_kernel.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

constexpr int kPoints = 20000;  // over the unit square: the spacing is 0.007
constexpr double kSpacing = 0.0071;
constexpr double kQuiet = 0.1 * kSpacing, kLoud = 0.6 * kSpacing;

double sigma_at(double x) { return x < 0.5 ? kQuiet : kLoud; }

// A plane of so many points where the noise is `loud` to the right of x = share, `quiet` elsewhere.
Points two_parts(int count, double share, double quiet, double loud) {
  Points points = shapes::plane(count);
  const Points unit = shapes::with_noise(Points(points.size()), 1);
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i].z += float((points[i].x < share ? quiet : loud) * unit[i].z);
  return points;
}

// The right half is six times as noisy as the left.
Points two_halves() { return two_parts(kPoints, 0.5, kQuiet, kLoud); }

struct Outcome : Ran {
  explicit Outcome(const Points& cloud, const Params& params = {})
      : Ran(cloud, params), settings(reference::settings_of(report.params, PipelineAccess::followed_noise(pipeline))) {}
  reference::Settings settings;
};
double sigma_said(const Outcome& outcome, const Point& p) {
  return outcome.report.params.noise.value * reference::noise_level(outcome.settings, p);
}

TEST(NoiseLevels, tell_the_noise_of_each_half_within_a_quarter) {
  const Points points = two_halves();
  const Outcome outcome(points);
  std::size_t good = 0, looked_at = 0;
  for (const Point& p : points) {
    if (std::abs(p.x - 0.5) < 0.1) continue;  // the field is smooth
    ++looked_at;
    good += std::abs(std::log(sigma_said(outcome, p) / sigma_at(p.x))) < std::log(1.25);
  }
  EXPECT_GT(double(good), 0.9 * double(looked_at));
}

// A quantile of the samples that are least would tell the quiet part.
TEST(NoiseLevels, stand_over_the_noise_of_a_typical_place) {
  constexpr int kMany = 50000;
  const double spacing = 1 / std::sqrt(kMany), loud = 0.6 * spacing;
  const Outcome outcome(two_parts(kMany, 0.3, 0.1 * spacing, loud));
  EXPECT_NEAR(outcome.report.params.noise.value, loud, 0.15 * loud);
}

// As in the frame of a depth camera, whose noise grows with the square of the distance. What is nearest is least noisy,
// but most of the frame is not near.
TEST(NoiseLevels, follow_noise_that_is_forty_times_as_large_elsewhere) {
  const double spacing = 0.0041, quiet = 0.01 * spacing, loud = 0.4 * spacing;
  const Points points = two_parts(60000, 0.25, quiet, loud);
  const Outcome outcome(points);
  std::size_t good = 0, looked_at = 0;
  for (const Point& p : points) {
    if (p.x < 0.35) continue;
    ++looked_at;
    good += std::abs(std::log(sigma_said(outcome, p) / loud)) < std::log(1.25);
  }
  EXPECT_GT(double(good), 0.9 * double(looked_at));
}

// The loud one would do where there is no shape that it flattens.
TEST(NoiseLevels, let_a_run_leave_less_than_the_noise_of_one_half_or_one_between) {
  const Points points = two_halves();
  const auto left = [](const Points& of) { return shapes::mean_error(of, [](Point p) { return p.z; }); };
  const double followed = left(Outcome(points).points);
  for (const double sigma : {kQuiet, std::sqrt(kQuiet * kLoud)}) {
    Params params;
    params.radius = 2.5 * sigma;  // given lengths follow nothing
    params.min_neighbors = 16;
    params.similarity_sigma = 3 * sigma;
    params.displacement_limit = 4 * sigma;
    params.outlier_distance = 6 * kLoud;
    params.relaxation = 1;
    EXPECT_LT(followed, left(Outcome(points, params).points)) << sigma;
  }
}

TEST(NoiseLevels, of_the_same_noise_everywhere_are_next_to_one) {
  const Points flat = shapes::with_noise(shapes::plane(kPoints), kQuiet);
  const Points round = shapes::with_noise(shapes::sphere(kPoints), 0.3 * 0.025);
  for (const Points& points : {flat, round}) {
    const Outcome outcome(points);
    for (const Point& p : points) ASSERT_NEAR(reference::noise_level(outcome.settings, p), 1, 0.15);
  }
}

// Where points are dense, neighbourhoods are narrow against the noise and show less of it.
TEST(NoiseLevels, of_the_same_noise_at_different_densities_are_next_to_one) {
  constexpr float kShare = 0.5f, kWidth = 0.02f;  // half of the points lie in a strip so wide: 49 times as dense
  Points points = shapes::plane(kPoints);
  for (Point& p : points)
    p.x = p.x < kShare ? p.x * kWidth / kShare : kWidth + (p.x - kShare) * (1 - kWidth) / (1 - kShare);
  points = shapes::with_noise(points, 3 * std::sqrt(kWidth / (kShare * kPoints)));
  const Outcome outcome(points);
  for (const Point& p : points) ASSERT_NEAR(reference::noise_level(outcome.settings, p), 1, 0.15);
}

TEST(NoiseLevels, are_followed_by_what_is_automatic_only) {
  const Points points = two_halves();
  Params params{.similarity_sigma = 0.01, .outlier_distance = 0.1, .displacement_limit = 0.02};
  const Outcome outcome(points, params);
  EXPECT_TRUE(outcome.settings.levels);
  EXPECT_TRUE(outcome.settings.radius_follows);
  EXPECT_FALSE(outcome.settings.similarity_follows);
  EXPECT_FALSE(outcome.settings.farthest_follows);
  EXPECT_EQ(outcome.settings.level_outlier_distance, 0);
  params.radius = 0.03;
  EXPECT_FALSE(Outcome(points, params).settings.radius_follows);
}

TEST(NoiseLevels, keep_to_a_noise_that_is_given) {
  const Points points = two_halves();
  Params params;
  params.noise = 2 * Outcome(points).report.params.noise.value;
  const Outcome outcome(points, params);
  EXPECT_NEAR(sigma_said(outcome, {0.8f, 0.5f, 0}) / sigma_said(Outcome(points), {0.8f, 0.5f, 0}), 2, 1e-6);
}

TEST(NoiseLevels, are_told_as_quantiles) {
  Pipeline pipeline = loaded(two_halves());
  const auto [quiet, typical, loud] = pipeline.estimates().noise_quantiles;
  EXPECT_NEAR(quiet, kQuiet, 0.25 * kQuiet);
  EXPECT_NEAR(loud, kLoud, 0.25 * kLoud);
  EXPECT_GE(typical, quiet);
  EXPECT_LE(typical, loud);
}

// Heights of a fifth of the spacing, in waves of six spacings, which hardly a neighbourhood can follow.
TEST(NoiseLevels, without_noise_hardly_a_point_moves) {
  const auto wave = [](double x, double y) { return 0.2 * kSpacing * std::sin(x / kSpacing) * std::sin(y / kSpacing); };
  const Points points = shapes::lifted(shapes::plane(kPoints), wave);
  EXPECT_LT(shapes::mean_distance(Outcome(points).points, points), 0.004 * kSpacing);
}

// Inside, outside, on nodes and nowhere.
TEST(NodeField, has_the_same_bits_in_every_kernel) {
  constexpr int kNodes = 5, kLeaves = 40, kPlaces = kLeaves * cpu::kLeafSize;
  shapes::Random random(4);
  std::vector<float> values;
  for (int i = 0; i < kNodes * kNodes * kNodes; ++i) values.push_back(float(random.uniform(0.2, 4)));
  const point::NodeField field{values.data(), kNodes, {-1, 2, 3}, 1.7f};
  std::vector<float> x, y, z;
  for (int i = 0; i < kPlaces; ++i) {
    x.push_back(i % 7 == 0 ? -1 + float(i % 6) / 1.7f : float(random.uniform(-3, 3)));
    y.push_back(i % 5 == 0 ? 2 + float(i % 6) / 1.7f : float(random.uniform(1, 6)));
    z.push_back(float(random.uniform(2, 7)));
  }
  for (int i = kPlaces - 5; i < kPlaces; ++i) x[i] = y[i] = z[i] = std::numeric_limits<float>::quiet_NaN();
  cpu::IndexView index{};
  index.x = x.data(), index.y = y.data(), index.z = z.data();
  index.points = kPlaces - 5, index.leaves = kLeaves;
  for (const cpu::Kernels* kernels : available_kernels())
    for (cpu::Index leaf = 0; leaf < cpu::Index(kLeaves); ++leaf) {
      float squared[cpu::kLeafSize];
      kernels->squared_levels(index, leaf, field, squared);
      for (cpu::Index lane = 0; lane < cpu::Index(cpu::kLeafSize); ++lane) {
        const cpu::Index i = leaf * cpu::kLeafSize + lane;
        const float level = point::node_value(field, {x[i], y[i], z[i]});
        ASSERT_EQ(squared[lane], level * level) << "point " << i << ", " << kernels->name;
      }
    }
}

}  // namespace
}  // namespace pointfair
