// SPDX-License-Identifier: Apache-2.0
// Noise that is alike in neighbouring points, as that of depth cameras, is told from shape and from other noise, and
// averaged over wider neighbourhoods.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "estimate/estimate.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "seam/backend.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

constexpr int kPoints = 20000;
constexpr double kSpacing = 0.00707;  // over the unit square
constexpr double kSigma = 0.2 * kSpacing;

// Heights of deviation `sigma` about z: two fifths of their variance are each point's own, the rest belongs to cells of
// 1.5 spacings and is interpolated between their corners.
Points with_correlated_noise(Points points, double sigma) {
  constexpr double kCell = 1.5 * kSpacing;
  shapes::Random random(7);
  const int side = int(1 / kCell) + 2;
  std::vector<double> corner(std::size_t(side * side));
  for (double& c : corner) c = random.normal();
  for (Point& p : points) {
    const int column = int(p.x / kCell), row = int(p.y / kCell);
    const double u = p.x / kCell - column, v = p.y / kCell - row;
    double field = 0, squares = 0;
    for (int i = 0; i < 4; ++i) {
      const double weight = (i % 2 ? u : 1 - u) * (i / 2 ? v : 1 - v);
      field += weight * corner[std::size_t((row + i / 2) * side + column + i % 2)];
      squares += weight * weight;
    }
    p.z += float(sigma * (std::sqrt(0.6 / squares) * field + std::sqrt(0.4) * random.normal()));
  }
  return points;
}

Points waves() {
  return shapes::lifted(shapes::plane(kPoints),
                        [](double x, double y) { return 0.004 * std::sin(60 * x) * std::cos(50 * y); });
}

bool is_shared(const Points& points) {
  const auto backend = make_cpu_backend(2);
  backend->upload(points, IndexOrder::fastest);
  backend->build_index(0, {}, {});
  return estimate(backend->sampling(), backend->sampling().sample_cloud(kSampledPoints), {.noise = true}, {})
      .noise.is_shared;
}

double rms_height_after_a_run(const Points& points, const Params& params) {
  return reference::rms(Ran(points, params).points, [](Point p) { return double{p.z}; });
}

TEST(CorrelatedNoise, is_told_from_other_noise_and_from_shape) {
  EXPECT_TRUE(is_shared(with_correlated_noise(shapes::plane(kPoints), kSigma)));
  for (const double level : {0.1, 0.2, 0.4}) {
    EXPECT_FALSE(is_shared(shapes::with_noise(shapes::plane(kPoints), level * kSpacing))) << level;
    EXPECT_FALSE(is_shared(shapes::with_noise(waves(), level * kSpacing))) << level;
  }
  EXPECT_FALSE(is_shared(waves()));
}

TEST(CorrelatedNoise, of_near_neighbours_is_halved) {
  const Points noisy = with_correlated_noise(shapes::plane(kPoints), kSigma);
  EXPECT_LT(rms_height_after_a_run(noisy, {}), 0.5 * kSigma);
}

// Each height is the mean of white noise over a box of four spacings about the point, as in a matcher's windows, and a
// little of its own.
Points with_noise_of_windows(Points points, double sigma) {
  constexpr int kReach = 8;  // cells of a quarter of the spacing
  constexpr double kCell = kSpacing / 4, kHalf = kReach * kCell;
  shapes::Random random(9);
  const int side = int((1 + 2 * kHalf) / kCell) + 2;
  std::vector<double> white(std::size_t(side * side));
  for (double& w : white) w = random.normal();
  for (Point& p : points) {
    const int column = int((p.x + kHalf) / kCell), row = int((p.y + kHalf) / kCell);
    double sum = 0;
    for (int i = -kReach; i < kReach; ++i)
      for (int j = -kReach; j < kReach; ++j) sum += white[std::size_t((row + i) * side + column + j)];
    p.z += float(sigma * (0.97 * sum / (2 * kReach) + 0.24 * random.normal()));
  }
  return points;
}

// With the 48 nearest points, .86 of it stays.
TEST(CorrelatedNoise, of_windows_is_averaged_over_many_of_them) {
  const double sigma = 0.5 * kSpacing;
  EXPECT_LT(rms_height_after_a_run(with_noise_of_windows(shapes::plane(kPoints), sigma), {}), 0.4 * sigma);
}

// It is bounded as such noise is. Taken for it, 1.5 times the noise would be left.
TEST(CorrelatedNoise, a_relief_of_one_wavelength_is_none) {
  constexpr double kFrequency = 2 * std::numbers::pi / (10 * kSpacing), kHeight = 0.3 * kSpacing,
                   kNoise = 0.1 * kSpacing;
  const auto relief = [](double x, double y) { return kHeight * std::sin(kFrequency * x) * std::cos(kFrequency * y); };
  const Points fair = Ran(shapes::with_noise(shapes::lifted(shapes::plane(kPoints), relief), kNoise)).points;
  EXPECT_LT(shapes::rms(fair, [&](Point p) { return p.z - relief(p.x, p.y); }), 0.8 * kNoise);
}

// Waves of .8 down to .025 of the side, each as high as it is long in the same measure. Residuals grow and slow as
// those of noise of windows, but keep their share of the spacing. Taken for it, as it was with these seeds, 24 times
// the noise would be left.
TEST(CorrelatedNoise, natural_ground_is_none) {
  const auto ground = [](double x, double y) {
    double z = 0;
    for (int octave = 0; octave < 6; ++octave)
      for (int wave = 0; wave < 3; ++wave) {
        const double length = 0.8 / (1 << octave), turn = 2.4 * (3 * octave + wave);
        const double along = std::cos(turn) * x + std::sin(turn) * y;
        z += length / 18 * std::cos(2 * std::numbers::pi * (1 + 0.23 * wave) / length * along + 1.7 * wave + octave);
      }
    return z;
  };
  constexpr int kSide = 141;
  constexpr double kNoise = 0.03 / kSide;
  for (const unsigned seed : {8u, 10u, 11u}) {
    shapes::Random random(seed);
    Points points;
    for (int i = 0; i < kSide * kSide; ++i) {
      const double x = (i % kSide + 0.5) / kSide, y = (i / kSide + 0.5) / kSide;
      points.push_back({float(x), float(y), float(ground(x, y) + kNoise * random.normal())});
    }
    EXPECT_LT(shapes::rms(Ran(points).points, [&](Point p) { return p.z - ground(p.x, p.y); }), 8 * kNoise) << seed;
  }
}

// Four waves of different lengths, of which the shortest is seven spacings long. Residuals of all points hardly know
// the longer ones, and those of thinned points do. Taken for noise, as before, 7 times the noise would be left of
// points anywhere, and 3.6 and 9 times of points in rows that are five times as dense along as across.
TEST(CorrelatedNoise, waves_longer_than_a_neighbourhood_are_none) {
  constexpr int kSide = 150;
  struct Case {
    double rows, height, power;
  };
  for (const auto& [rows, height, power] :
       {Case{0, .05, .6}, Case{std::sqrt(5.0), .02, .3}, Case{std::sqrt(5.0), .05, .3}}) {
    const auto ground = [&](Point p) {
      double z = 0;
      int wave = 0;
      for (const auto& [longer, turn] : {std::array{1.0, .3}, {2.7, 1.9}, {7.3, 4.1}, {19.0, 5.2}}) {
        const double along = std::cos(turn) * p.x + std::sin(turn) * p.y;
        z += 7 * height * std::pow(longer, power) * std::cos(2 * std::numbers::pi / (7 * longer) * along + wave++);
      }
      return z;
    };
    constexpr double kNoise = 0.03;
    shapes::Random random(6);
    Points points;
    for (int i = 0; i < kSide * kSide; ++i) {
      const double x = kSide * random.uniform(), y = kSide * random.uniform();
      points.push_back({float(x), float(rows > 0 ? rows * std::round(y / rows) : y), 0});
      points.back().z = float(ground(points.back()) + kNoise * random.normal());
    }
    EXPECT_LT(shapes::rms(Ran(points).points, [&](Point p) { return p.z - ground(p); }), 1.5 * kNoise)
        << rows << ' ' << height;
  }
}

// A camera's frame of twenty slanted tiles at 1 to 3 m.
struct DepthFrame {
  static constexpr double kSlant = 0.4;
  Points points;
  std::vector<double> depths;  // of each point's tile, on the axis

  double rms_distance(const Points& of) const {
    double sum = 0;
    for (std::size_t i = 0; i < of.size(); ++i) sum += std::pow(of[i].z - kSlant * of[i].x - depths[i], 2);
    return std::sqrt(sum / double(of.size()) / (1 + kSlant * kSlant));
  }
};

// Disparities err by white noise of `white` pixels and by the mean of noise over two windows of five pixels, one after
// the other, whose deviation is `matched`.
DepthFrame depth_frame(double matched, double white) {
  constexpr int kWidth = 200, kHeight = 160, kTile = 40, kReach = 4, kColumns = kWidth + 2 * kReach;
  constexpr double kFocal = 200, kBase = 0.075 * kFocal;
  shapes::Random random(3);
  std::vector<double> noise(std::size_t(kColumns * (kHeight + 2 * kReach)));
  for (double& value : noise) value = random.normal();
  DepthFrame frame;
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column) {
      double shared = 0, squares = 0;
      for (int i = 0; i <= 2 * kReach; ++i)
        for (int j = 0; j <= 2 * kReach; ++j) {
          const double weight = (1 + kReach - std::abs(i - kReach)) * (1 + kReach - std::abs(j - kReach));
          shared += weight * noise[std::size_t((row + i) * kColumns + column + j)];
          squares += weight * weight;
        }
      const int tile = row / kTile * (kWidth / kTile) + column / kTile;
      frame.depths.push_back(1 + 2.0 * (7 * tile % 20) / 19);
      const double u = (column - kWidth / 2 + .5) / kFocal, v = (row - kHeight / 2 + .5) / kFocal;
      const double depth = frame.depths.back() / (1 - DepthFrame::kSlant * u);
      const double z = kBase / (kBase / depth + matched * shared / std::sqrt(squares) + white * random.normal());
      frame.points.push_back({float(u * z), float(v * z), float(z)});
    }
  return frame;
}

// .98 was left while only residuals were asked, which grow here as those of shape do. Noise of the same law that no
// pixels share is averaged as other noise is.
TEST(CorrelatedNoise, of_cameras_that_match_images_is_told_by_its_growth_with_the_distance) {
  const DepthFrame matched = depth_frame(0.1, 0.02);
  EXPECT_TRUE(is_shared(matched.points));
  EXPECT_LT(matched.rms_distance(Ran(matched.points).points), 0.7 * matched.rms_distance(matched.points));
  const DepthFrame white = depth_frame(0, 0.05);
  EXPECT_FALSE(is_shared(white.points));
  EXPECT_LT(white.rms_distance(Ran(white.points).points), 0.25 * white.rms_distance(white.points));
}

}  // namespace
}  // namespace pointfair
