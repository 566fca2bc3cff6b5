// SPDX-License-Identifier: Apache-2.0
// The noise estimate against known noise.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "estimate/estimate.hpp"
#include "seam/backend.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

Noise measured_noise(const Points& points) {
  const std::unique_ptr<Backend> backend = make_cpu_backend(2);
  backend->upload(points, IndexOrder::fastest);
  backend->build_index(0, {}, {});
  return estimate(backend->sampling(), backend->sampling().sample_cloud(kSampledPoints), {.noise = true}, {}).noise;
}

TEST(Noise, on_waves_is_near_the_truth_far_above_the_spacing_and_below) {
  Points points = shapes::with_noise(shapes::waves(4000), 0.02);
  for (const double flat : {1.0, 0.05}) {
    for (Point& p : points) p.z = float(p.z * flat);
    EXPECT_NEAR(measured_noise(points).sigma, 0.02 * flat, 0.25 * 0.02 * flat) << flat;
  }
}

// Spacing of the sphere's points: sqrt(4 pi / 20000) = 0.025.
TEST(Noise, on_a_sphere_is_near_the_truth_from_a_tenth_of_the_spacing_to_the_spacing) {
  for (const double sigma : {0.0025, 0.00625, 0.0125, 0.025}) {
    Points points = shapes::sphere(20000);
    shapes::Random random(3);
    for (Point& p : points) {
      const float r = float(1 + sigma * random.normal());
      p = {p.x * r, p.y * r, p.z * r};
    }
    const Noise noise = measured_noise(points);
    EXPECT_NEAR(noise.sigma, sigma, (sigma < 0.00625 ? 0.3 : 0.15) * sigma) << sigma;
    EXPECT_NEAR(noise.surface_spacing, 0.025, 0.1 * 0.025) << sigma;
  }
}

// Lines across which points are 25 times as far apart as along, each in a plane of its own, as a scanner's turns are;
// noise is along the ray only.
TEST(Noise, on_scan_lines_is_that_along_the_rays) {
  constexpr double kSigma = 0.002;
  shapes::Random random(5);
  Points points;
  for (int line = 0; line < 40; ++line)
    for (int i = 0; i < 1000; ++i) {
      const double x = 0.001 * (i + random.uniform()), y = 0.025 * line;
      points.push_back(
          {float(x), float(y), float(0.05 * std::sin(4 * x) * std::cos(3 * y) + kSigma * random.normal())});
    }
  EXPECT_NEAR(measured_noise(points).sigma, kSigma, 0.15 * kSigma);
}

TEST(Noise, is_not_seen_among_copies_of_a_point) {
  Points points = shapes::with_noise(shapes::plane(5000), 0.01);
  const double alone = measured_noise(points).sigma;
  points.insert(points.end(), 2000, points.front());
  EXPECT_NEAR(measured_noise(points).sigma, alone, 0.05 * alone);
}

// As where two files of one survey overlap.
TEST(Noise, is_the_same_where_points_are_there_twice) {
  const Points alone = shapes::with_noise(shapes::waves(20000), 0.004);
  const Noise of_each = measured_noise(alone);
  for (const double share : {0.3, 1.0}) {
    Points repeated = alone;
    repeated.insert(repeated.end(), alone.begin(), alone.begin() + std::ptrdiff_t(share * double(alone.size())));
    const Noise found = measured_noise(repeated);
    EXPECT_NEAR(found.sigma, of_each.sigma, 0.05 * of_each.sigma) << share;
    EXPECT_NEAR(found.surface_spacing, of_each.surface_spacing, 0.05 * of_each.surface_spacing) << share;
    EXPECT_FALSE(found.is_shared) << share;
  }
}

// The sheets of a thin part are no noise: 10,000 points each over the unit square, spacing 0.01.
TEST(Noise, of_two_sheets_is_that_of_each) {
  for (const double gap : {0.011, 0.015, 0.022})
    for (const double sigma : {0.001, 0.0018}) {
      const Noise noise = measured_noise(shapes::with_noise(shapes::two_sheets(20000, gap), sigma));
      EXPECT_NEAR(noise.sigma, sigma, 0.2 * sigma) << gap;
      EXPECT_NEAR(noise.gap, gap, 0.15 * gap) << sigma;
      EXPECT_NEAR(noise.surface_spacing, 0.01, 0.003) << gap;  // 0.0071 if both sheets counted
    }
  EXPECT_LT(measured_noise(shapes::two_sheets(20000, 0.015)).sigma, 1e-6);
}

// Half of what lies between such sheets is the noise of both together.
TEST(Noise, of_sheets_four_to_five_sigmas_apart_is_that_of_each) {
  for (const double gap : {0.011, 0.015, 0.022, 0.03}) {
    const double sigma = gap / 4.5;
    const Noise noise = measured_noise(shapes::with_noise(shapes::two_sheets(20000, gap), sigma));
    EXPECT_NEAR(noise.sigma, sigma, 0.1 * sigma) << gap;
    EXPECT_NEAR(noise.gap, gap, 0.2 * gap);
  }
}

// Too near to be told from one sheet at each sample: the whole cloud tells.
TEST(Noise, of_sheets_that_overlap_is_that_of_each) {
  for (const double gap : {0.011, 0.015})
    for (const double sigmas : {2.6, 3.0, 3.5}) {
      const double sigma = gap / sigmas;
      const Noise noise = measured_noise(shapes::with_noise(shapes::two_sheets(20000, gap), sigma));
      EXPECT_NEAR(noise.sigma, sigma, 0.25 * sigma) << gap << ' ' << sigmas;
      EXPECT_NEAR(noise.gap, gap, 0.2 * gap) << sigmas;
    }
}

// Two groups of its heights look like such sheets.
TEST(Noise, that_is_even_between_two_bounds_is_of_one_sheet) {
  for (const float most : {0.01f, 0.02f}) {  // spacing 0.01
    Points points = shapes::plane(10000);
    std::mt19937 random(7);
    std::uniform_real_distribution<float> even(-most, most);
    for (Point& p : points) p.z += even(random);
    const Noise noise = measured_noise(points);
    EXPECT_EQ(noise.gap, 0) << most;
    EXPECT_NEAR(noise.sigma, most / std::sqrt(3.0), 0.1 * most);
  }
}

// As by a scanner that is off at its second sweep.
TEST(Noise, of_a_surface_that_was_seen_twice_is_that_of_both) {
  const double gap = 0.003;  // spacing 0.01
  const Noise noise = measured_noise(shapes::with_noise(shapes::two_sheets(20000, gap), gap / 4.5));
  EXPECT_EQ(noise.gap, 0);
  EXPECT_GT(noise.sigma, 0.4 * gap);
}

// Their heights are those of two sheets, but beside each other.
TEST(Noise, of_bars_three_spacings_wide_has_no_gap) {
  Points bars = shapes::plane(10000);
  for (Point& p : bars) p.z = std::fmod(p.x, 0.06f) < 0.03f ? 0.01f : -0.01f;
  EXPECT_EQ(measured_noise(shapes::with_noise(bars, 0.02 / 4.5)).gap, 0);
}

// Residuals that grow and then fall, since only wide neighbourhoods part the heights of bars, are no shared noise.
TEST(Noise, of_bars_is_not_shared) {
  for (const float width : {0.04f, 0.05f}) {
    Points bars = shapes::plane(10000);
    for (Point& p : bars) p.z = std::fmod(p.x, 2 * width) < width ? 0.02f : -0.02f;
    EXPECT_FALSE(measured_noise(shapes::with_noise(bars, 0.001)).is_shared) << width;
  }
}

TEST(Noise, of_one_sheet_has_no_gap) {
  for (const double sigma : {0.0, 0.001, 0.01, 0.03}) {
    EXPECT_EQ(measured_noise(shapes::with_noise(shapes::plane(10000), sigma)).gap, 0) << sigma;
    EXPECT_EQ(measured_noise(shapes::with_noise(shapes::waves(10000), sigma)).gap, 0) << sigma;
    EXPECT_EQ(measured_noise(shapes::with_noise(shapes::cube(10000), sigma)).gap, 0) << sigma;
  }
}

TEST(Noise, tells_room_for_wide_neighbourhoods_from_none) {
  for (const double sigma : {0.007, 0.01, 0.02, 0.03}) {  // 10,000 points on a unit square: spacings of 0.01
    const Noise plane = measured_noise(shapes::with_noise(shapes::plane(10000), sigma));
    EXPECT_LT(plane.confined, 0.01) << sigma;
  }
  Points strewn = shapes::with_noise(shapes::plane(10000), 0.01);
  for (std::size_t i = 0; i < strewn.size(); i += 100) strewn[i].z += i % 200 == 0 ? 0.2f : -0.2f;
  EXPECT_LT(measured_noise(strewn).confined, 0.02) << "outliers are no shape";
  // a neighbourhood of 4 noise sigmas: no neighbourhood of one side is wide
  const Noise small = measured_noise(shapes::with_noise(shapes::sphere(4000), 0.25));
  EXPECT_GT(small.confined, 0.2);
}

TEST(Noise, of_a_clean_sphere_is_next_to_none) { EXPECT_LT(measured_noise(shapes::sphere(20000)).sigma, 0.0025); }

TEST(Noise, of_clouds_without_a_surface_is_none) {
  EXPECT_EQ(measured_noise(shapes::identical(100)).sigma, 0);
  EXPECT_EQ(measured_noise(shapes::sphere(10)).sigma, 0);
  EXPECT_EQ(measured_noise({}).sigma, 0);
}

}  // namespace
}  // namespace pointfair
