// SPDX-License-Identifier: Apache-2.0
// Mean heights over cells: whatever the order of the points, and the plain means of their cells.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "options/height_grid.hpp"
#include "pointfair/outliers.hpp"

namespace pointfair::test {
namespace {

std::vector<Point> some_points(std::size_t count, float far, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> wide(-far, far), high(-30, 900);
  std::vector<Point> points(count);
  for (Point& p : points) p = {wide(random), wide(random), high(random)};
  for (std::size_t i = 0; i + 1 < count; i += 2) points[i + 1] = {points[i].x * .1F, points[i].y * .1F, points[i].z};
  return points;
}

HeightGrid grid_of(const std::vector<Point>& points) {
  HeightGrid grid(points.size());
  for (const Point& p : points) grid.add(p);
  grid.finish();
  return grid;
}

using Means = std::map<std::pair<double, double>, std::pair<double, double>>;  // by cell: sum, count

Means means_of(const std::vector<Point>& points, int exponent) {
  Means means;
  for (const Point& p : points) {
    auto& [sum, count] = means[{std::floor(std::ldexp(p.x, -exponent)), std::floor(std::ldexp(p.y, -exponent))}];
    sum += p.z;
    ++count;
  }
  return means;
}

}  // namespace

TEST(HeightGrid, CellsAreTheSmallestThatAreFewEnoughAndHaveTheMeansOfTheirPoints) {
  for (const float far : {.01F, 3.F, 5e3F, 2e7F}) {
    const std::vector<Point> points = some_points(20000, far, 3);
    const HeightGrid grid = grid_of(points);
    const Means means = means_of(points, grid.exponent());
    EXPECT_LE(means.size(), points.size() / 16);
    EXPECT_GT(means_of(points, grid.exponent() - 1).size(), points.size() / 16);
    EXPECT_EQ(grid.cells().size(), means.size());
    for (std::size_t i = 0; i < points.size(); i += 50) {
      const Point& p = points[i];
      const auto [sum, count] =
          means.at({std::floor(std::ldexp(p.x, -grid.exponent())), std::floor(std::ldexp(p.y, -grid.exponent()))});
      EXPECT_NEAR(grid.height_at(p).value(), sum / count, 1e-6);
    }
  }
}

TEST(HeightGrid, TheOrderOfThePointsChangesNoBit) {
  std::vector<Point> points = some_points(150000, 700, 5);  // settles more than once
  const HeightGrid grid = grid_of(points);
  std::mt19937 random(1);
  std::shuffle(points.begin(), points.end(), random);
  const HeightGrid shuffled = grid_of(points);
  ASSERT_EQ(grid.exponent(), shuffled.exponent());
  ASSERT_EQ(grid.cells().size(), shuffled.cells().size());
  const HeightGrid stored(grid.exponent(), grid.cells());
  for (const Point& p : some_points(3000, 2000, 7)) {
    EXPECT_EQ(grid.height_at(p), shuffled.height_at(p));
    EXPECT_EQ(grid.height_at(p), stored.height_at(p));
  }
}

TEST(HeightGrid, WhereACellIsEmptyTheNextLargerCounts) {
  std::vector<Point> points;
  for (int i = 0; i < 4096; ++i) points.push_back({float(i % 64), float(i / 64), 5});
  for (Point& p : points) p.z = p.x < 32 ? 1 : 9;
  const HeightGrid grid = grid_of(points);
  EXPECT_EQ(grid.height_at({3.5F, 60, 77}), 1);
  EXPECT_EQ(grid.height_at({100, 3, 77}), 5);     // of the square that is twice as wide
  EXPECT_EQ(grid.height_at({-1e20F, 3, 77}), 5);  // of all
  EXPECT_EQ(HeightGrid(0).height_at({0, 0, 0}), std::nullopt);
  HeightGrid none(100);
  none.finish();
  EXPECT_EQ(none.height_at({0, 0, 0}), std::nullopt);
}

TEST(OutlierActions, NumbersOfPointsThatDifferAreRefused) {
  Cloud cloud;
  cloud.points.resize(3);
  const std::vector<std::uint8_t> reasons(2);
  const OutlierAction action{OutlierAction::Kind::classify, {}};
  EXPECT_THROW(act_on_outliers(action, reasons, cloud.points, cloud), Error);
}

}  // namespace pointfair::test
