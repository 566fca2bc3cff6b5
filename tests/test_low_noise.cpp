// SPDX-License-Identifier: Apache-2.0
// With nothing set a run leaves no more than it found where noise is small against the shape that a neighbourhood
// cannot follow.
#include <gtest/gtest.h>

#include <cmath>

#include "pointfair/pointfair.hpp"
#include "runs.h"
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

Points hills() { return shapes::lifted(shapes::plane(kPoints), height); }

// Slopes are 0.24 at most, so heights are distances within 3 %.
double mean_distance(const Points& points) {
  return shapes::mean_error(points, [](Point p) { return p.z - height(p.x, p.y); });
}

double left_by_a_run(const Points& points) { return mean_distance(Ran(points).points); }

// A roof of right angle, its crest along x = 0.5.
double roof(double x) { return -std::abs(x - 0.5); }

Points roofs() {
  return shapes::lifted(shapes::plane(kPoints), [](double x, double) { return roof(x); });
}

double mean_over_the_roof(const Points& points) {
  return shapes::mean_error(points, [](Point p) { return (p.z - roof(p.x)) / std::sqrt(2.0); });
}

// Root mean square of the distances to the roof, of the points that lay within three spacings of its crest.
double rms_at_the_crest(const Points& points, const Points& start) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!(std::abs(start[i].x - 0.5) < 0.021)) continue;
    const double over = (points[i].z - roof(points[i].x)) / std::sqrt(2.0);
    sum += over * over;
    count += 1;
  }
  return std::sqrt(sum / count);
}

TEST(LowNoise, is_not_raised_by_a_run) {
  for (const double sigma : {0.0001, 0.0002, 0.0003, 0.0005, 0.001, 0.002}) {
    const Points noisy = shapes::with_noise(hills(), sigma);
    EXPECT_LT(left_by_a_run(noisy), mean_distance(noisy)) << sigma;
  }
}

TEST(LowNoise, is_not_raised_at_a_crest) {
  const Points clean = roofs();
  for (const double sigma : {0.00007, 0.0002, 0.0005, 0.001, 0.002}) {  // 0.01 to 0.28 spacings
    const Points noisy = shapes::with_noise(clean, sigma);
    EXPECT_LT(rms_at_the_crest(Ran(noisy).points, noisy), rms_at_the_crest(noisy, noisy)) << sigma;
  }
}

// As of a terrestrial scanner outdoors: noise of 1 mm, points 7 cm apart.
TEST(LowNoise, of_a_seventieth_of_the_spacing_is_removed) {
  const Points noisy = shapes::with_noise(roofs(), 0.0001);
  EXPECT_LT(mean_over_the_roof(Ran(noisy).points), 0.6 * mean_over_the_roof(noisy));
}

TEST(LowNoise, grows_into_much_noise_without_a_jump_of_the_relaxation) {
  Points steep = hills();
  for (Point& p : steep) p.z *= 10;
  double last = 0;
  for (double level = 0.2; level < 0.78; level += 0.02) {  // spacings
    const double relaxation = Ran(shapes::with_noise(steep, 0.007 * level)).report.params.relaxation.value();
    if (last > 0) {
      EXPECT_LE(std::abs(relaxation - last), 0.12) << level;
    }
    last = relaxation;
  }
  EXPECT_GE(last, 0.99);
}

TEST(LowNoise, without_noise_hardly_a_point_moves) { EXPECT_LT(left_by_a_run(hills()), 0.00003); }

}  // namespace
}  // namespace pointfair
