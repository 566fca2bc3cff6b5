// SPDX-License-Identifier: Apache-2.0
// With nothing set a run leaves no more than it found where noise is small against the shape that a ball cannot follow.
#include <gtest/gtest.h>

#include <cmath>

#include "pointfair/pointfair.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

constexpr int kPoints = 20000;  // over the unit square: the spacing is 0.007
constexpr double kWave = 0.1;   // half a wave is 14 spacings

// A smooth wave of parabolas along one axis, of height 1 each, up and down in turn.
double wave(double t) {
  const double place = t / kWave, whole = std::floor(place), u = place - whole;
  return (std::fmod(whole, 2) == 0 ? 4 : -4) * u * (1 - u);
}
double height(double x, double y) { return 0.006 * wave(x) * wave(y); }

Points hills() {
  Points points = shapes::plane(kPoints);
  for (Point& p : points) p.z = float(height(p.x, p.y));
  return points;
}

// Slopes are 0.24 at most, so heights are distances within 3 %.
double mean_distance(const Points& points) {
  double sum = 0;
  for (const Point& p : points) sum += std::abs(p.z - height(p.x, p.y));
  return sum / double(points.size());
}

double left_by_a_run(const Points& points) {
  Pipeline pipeline(Device::cpu);
  pipeline.load(points);
  Points out(points.size());
  pipeline.run({}, out);
  return mean_distance(out);
}

TEST(LowNoise, is_not_raised_by_a_run) {
  for (const double sigma : {0.0001, 0.0002, 0.0003, 0.0005, 0.001, 0.002}) {
    const Points noisy = shapes::with_noise(hills(), sigma);
    EXPECT_LT(left_by_a_run(noisy), mean_distance(noisy)) << sigma;
  }
}

TEST(LowNoise, without_noise_there_is_hardly_a_step) { EXPECT_LT(left_by_a_run(hills()), 0.00003); }

}  // namespace
}  // namespace pointfair
