// SPDX-License-Identifier: Apache-2.0
// Single sweeps of a lidar with few beams: points lie in rows, close along them and far apart across.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

struct Sweep {
  Points points;
  std::vector<int> plane;  // that each lies on
};

// A hall around the sensor: walls in four directions, that stand askew, and the floor.
constexpr int kPlanes = 5;
constexpr double kNormals[kPlanes][3] = {
    {0.96, 0.28, 0}, {-0.96, -0.28, 0}, {-0.28, 0.96, 0}, {0.28, -0.96, 0}, {0, 0, -1}};
constexpr double kDistances[kPlanes] = {9, 6, 7, 4, 1.2};

double height(const Point& p, int plane) {
  return (kNormals[plane][0] * p.x + kNormals[plane][1] * p.y + kNormals[plane][2] * p.z) - kDistances[plane];
}

// Noise along the rays, of standard deviation `sigma`, in metres.
Sweep sweep_of(int beams, double sigma) {
  shapes::Random random(7);
  Sweep sweep;
  for (int beam = 0; beam < beams; ++beam)
    for (int step = 0; step < 1800; ++step) {
      const double up = (beam * 30.0 / (beams - 1) - 15) * std::numbers::pi / 180;
      const double around = (step + 0.5) * std::numbers::pi / 900;
      const double ray[3] = {std::cos(up) * std::cos(around), std::cos(up) * std::sin(around), std::sin(up)};
      double range = 1e9;
      int plane = 0;
      for (int i = 0; i < kPlanes; ++i) {
        const double cosine = kNormals[i][0] * ray[0] + kNormals[i][1] * ray[1] + kNormals[i][2] * ray[2];
        if (cosine > 0 && kDistances[i] / cosine < range) range = kDistances[i] / cosine, plane = i;
      }
      range += sigma * random.normal();
      sweep.points.push_back(shapes::make_point(range * ray[0], range * ray[1], range * ray[2]));
      sweep.plane.push_back(plane);
    }
  return sweep;
}

double median_height(const Points& points, const std::vector<int>& plane) {
  std::vector<double> heights;
  for (std::size_t i = 0; i < points.size(); ++i) heights.push_back(std::abs(height(points[i], plane[i])));
  std::nth_element(heights.begin(), heights.begin() + heights.size() / 2, heights.end());
  return heights[heights.size() / 2];
}
double mean_height(const Points& points, const std::vector<int>& plane) {
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) sum += std::abs(height(points[i], plane[i])) / double(points.size());
  return sum;
}

// A cubic through two or three rows meets their points whatever the noise, and one through more does not.
TEST(Sweeps, of_few_beams_are_denoised_and_their_noise_is_known) {
  for (const int beams : {16, 32}) {
    const Sweep sweep = sweep_of(beams, 0.012);
    const Ran outcome(sweep.points);
    const double typical = median_height(sweep.points, sweep.plane) / 0.6745;
    EXPECT_NEAR(outcome.report.params.noise.value / typical, 1, 0.35) << beams;
    EXPECT_LT(mean_height(outcome.points, sweep.plane), 0.6 * mean_height(sweep.points, sweep.plane)) << beams;
  }
}

TEST(Sweeps, without_noise_stay_as_they_are) {
  for (const int beams : {16, 32}) {
    const Sweep sweep = sweep_of(beams, 0);
    const double moved = shapes::mean_distance(Ran(sweep.points).points, sweep.points);
    EXPECT_LT(moved, 0.0005) << beams;  // a hundredth of the spacing or less
  }
}

}  // namespace
}  // namespace pointfair
