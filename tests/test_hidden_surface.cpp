// SPDX-License-Identifier: Apache-2.0
// A surface that most points do not lie on is found, and what is none keeps its place.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using Points = std::vector<Point>;

constexpr double kSide = 80, kNoise = 0.05;

// A slanted ground, then crowns: balls evenly filled, above it.
struct Forest {
  Points points;
  std::size_t ground;
};
Forest forest(std::size_t ground, std::size_t crown, unsigned seed, double noise = kNoise) {
  shapes::Random random(seed);
  Forest result{{}, ground};
  const auto height = [](double x, double y) { return 0.1 * x + 0.02 * y; };
  for (std::size_t i = 0; i < ground; ++i) {
    const double x = kSide * random.uniform(), y = kSide * random.uniform();
    result.points.push_back({float(x), float(y), float(height(x, y) + noise * random.normal())});
  }
  constexpr std::size_t kPointsOfCrown = 40;
  while (result.points.size() < ground + crown) {
    const double x = kSide * random.uniform(), y = kSide * random.uniform();
    const double radius = 1.5 + 2 * random.uniform(), above = radius + 3 + 8 * random.uniform();
    for (std::size_t i = 0; i < kPointsOfCrown; ++i) {
      const double up = 2 * random.uniform() - 1, turn = 2 * std::numbers::pi * random.uniform();
      const double r = radius * std::cbrt(random.uniform()), across = r * std::sqrt(1 - up * up);
      result.points.push_back({float(x + across * std::cos(turn)), float(y + across * std::sin(turn)),
                               float(height(x, y) + above + r * up)});
    }
  }
  return result;
}

double height_of(const Point& p) { return (p.z - 0.1 * p.x - 0.02 * p.y) / std::sqrt(1 + 0.01 + 0.0004); }
using shapes::distance;

// The ground gets no worse, crowns stay but for a share of their points, and the run says that most points show no
// surface.
void expect_no_harm(const Forest& made, unsigned seed, double share = 0) {
  Ran run(made.points);
  const Points& after = run.points;
  double before_squares = 0, squares = 0, moved = 0;
  for (std::size_t i = 0; i < made.ground; ++i) {
    before_squares += std::pow(height_of(made.points[i]), 2);
    squares += std::pow(height_of(after[i]), 2);
  }
  for (std::size_t i = made.ground; i < after.size(); ++i)
    moved += distance(after[i], made.points[i]) < 0.2 ? 0 : 1;  // crown points are 1 apart
  EXPECT_LT(squares, 1.05 * 1.05 * before_squares) << seed;
  EXPECT_LE(moved, share * double(after.size() - made.ground)) << seed;
  EXPECT_GT(run.pipeline.estimates().without_surface, 0.5) << seed;
}

TEST(HiddenSurface, ground_between_crowns_gets_no_worse_and_crowns_stay) {
  for (const unsigned seed : {1u, 2u, 3u}) expect_no_harm(forest(400, 3200, seed), seed);
}

// Half of 16 points lie farther off their plane there than by chance.
TEST(HiddenSurface, dense_ground_with_noise_of_a_tenth_of_its_spacing_gets_no_worse) {
  for (const unsigned seed : {1u, 2u, 3u}) expect_no_harm(forest(1500, 12000, seed, 0.2), seed, 0.01);
}

TEST(HiddenSurface, without_noise_stays_as_it_is) {
  const Forest made = forest(400, 3200, 1, 0);
  Ran run(made.points);
  const Points& after = run.points;
  for (std::size_t i = 0; i < after.size(); ++i) ASSERT_LT(distance(after[i], made.points[i]), 1e-3) << i;
  EXPECT_GT(run.pipeline.estimates().without_surface, 0.5);
}

TEST(HiddenSurface, is_not_seen_in_noise_however_large) {
  for (const double spacings : {0.6, 1.0, 2.0, 4.0})
    for (const unsigned seed : {1u, 2u}) {
      const Points points = shapes::with_noise(shapes::plane(20000), spacings / std::sqrt(20000.0), seed);
      Pipeline pipeline = loaded(points);
      EXPECT_EQ(pipeline.estimates().without_surface, 0) << spacings << " " << seed;
    }
}

// Of a scanner that is driven past, whose beam turns in a plane: noise lies in that plane too, and reaches over the
// next profile's points.
TEST(HiddenSurface, is_no_plane_of_a_profile) {
  constexpr int kPoints = 40000, kProfiles = 200;
  const auto height = [](double x, double y) { return 0.05 * std::sin(3 * x) + 0.03 * y; };
  for (const double noise : {0.005, 0.01}) {
    shapes::Random random(3);
    Points points;
    for (int i = 0; i < kPoints; ++i) {
      const double x = random.uniform(), y = double(i % kProfiles) / kProfiles;
      points.push_back({float(x), float(y), float(height(x, y) + noise * random.normal())});
    }
    Ran run(points);
    EXPECT_LT(shapes::rms(run.points, [&](Point p) { return p.z - height(p.x, p.y); }), 0.25 * noise);
    EXPECT_EQ(run.pipeline.estimates().without_surface, 0) << noise;
  }
}

}  // namespace
}  // namespace pointfair
