// SPDX-License-Identifier: Apache-2.0
// Points that are copies of each other count once: a run leaves as little as it does of one copy.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

constexpr double kNoise = 0.005;

Points noisy_plane() {
  Points points = shapes::plane(3000);
  shapes::Random random(5);
  for (Point& p : points) p.z = float(kNoise * random.normal());
  return points;
}

// Each point so many times, each coordinate off by up to `rounding`.
Points repeated(const Points& points, int times, double rounding) {
  Points all;
  shapes::Random random(6);
  for (const Point& p : points)
    for (int i = 0; i < times; ++i) {
      Point copy = p;
      for (float* value : {&copy.x, &copy.y, &copy.z})
        *value = float(double(*value) + rounding * (2 * random.uniform() - 1));
      all.push_back(copy);
    }
  return all;
}

double rms_height(const Points& points) {
  return reference::rms(points, [](Point p) { return double{p.z}; });
}

TEST(Repeats, leave_as_little_noise_as_one_copy) {
  const double once = rms_height(Ran(noisy_plane()).points);
  ASSERT_LT(once, 0.15 * kNoise);
  for (const int times : {2, 3, 5, 7})
    EXPECT_LT(rms_height(Ran(repeated(noisy_plane(), times, 0)).points), 1.1 * once) << times << " copies";
  EXPECT_LT(rms_height(Ran(repeated(noisy_plane(), 10, 0)).points), 1.4 * once);
}

TEST(Repeats, that_differ_by_their_rounding_count_once) {
  const double once = rms_height(Ran(noisy_plane()).points);
  for (const int times : {2, 5})
    EXPECT_LT(rms_height(Ran(repeated(noisy_plane(), times, 1e-6)).points), 1.1 * once) << times << " copies";
}

TEST(Repeats, stay_together) {
  const Points out = Ran(repeated(noisy_plane(), 5, 0)).points;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Point& first = out[i / 5 * 5];
    ASSERT_TRUE(out[i].x == first.x && out[i].y == first.y && out[i].z == first.z) << i;
  }
}

TEST(Repeats, of_unwelded_faces_leave_as_little_noise_as_welded_ones) {
  Points vertices = shapes::sphere(4000);
  shapes::Random random(7);
  for (Point& p : vertices) {
    const double radius = 1 + 0.01 * random.normal();
    p = {float(radius * p.x), float(radius * p.y), float(radius * p.z)};
  }
  const auto off_the_sphere = [](const Points& points) {
    return reference::rms(points, [](Point p) { return reference::length(reference::to_vec(p)) - 1; });
  };
  EXPECT_LT(off_the_sphere(Ran(repeated(vertices, 6, 0)).points), 1.2 * off_the_sphere(Ran(vertices).points));
}

// The nodes of a mesh lie on multiples of its step, and none of them was rounded.
TEST(Repeats, are_none_in_a_cube_of_a_regular_mesh_which_stays_as_it_is) {
  constexpr int kCells = 15;
  Points cube;
  for (int x = 0; x <= kCells; ++x)
    for (int y = 0; y <= kCells; ++y)
      for (int z = 0; z <= kCells; ++z)
        if (x % kCells == 0 || y % kCells == 0 || z % kCells == 0) cube.push_back({float(x), float(y), float(z)});
  const Points out = Ran(cube).points;
  for (std::size_t i = 0; i < cube.size(); ++i)
    ASSERT_LT(std::hypot(out[i].x - cube[i].x, out[i].y - cube[i].y, out[i].z - cube[i].z), 0.05) << i;
}

// Rows along x, each with one height of its own and with noise of its points.
Points in_rows(const std::function<double(int)>& height, double noise) {
  constexpr int kRows = 60, kOfRow = 500;
  Points points;
  shapes::Random random(8);
  for (int row = 0; row < kRows; ++row)
    for (int i = 0; i < kOfRow; ++i)
      points.push_back(shapes::make_point((i + random.uniform()) / kOfRow, double(row) / kRows,
                                          height(row) + noise * random.normal()));
  return points;
}

// Of the points whose neighbourhoods have rows on both sides.
double rms_off(const Points& points, const std::function<double(int)>& height) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int row = int(i / 500);
    if (row < 5 || row >= 55) continue;
    const double off = points[i].z - height(row);
    sum += off * off;
    ++count;
  }
  return std::sqrt(sum / double(count));
}

TEST(Repeats, include_points_of_a_row_that_share_an_error) {
  shapes::Random random(9);
  std::vector<double> error(60);
  for (double& its : error) its = 0.003 * random.normal();
  const Points noisy = in_rows([&](int row) { return error[std::size_t(row)]; }, 0.0005);
  const auto flat = [](int) { return 0.0; };
  EXPECT_LT(rms_off(Ran(noisy).points, flat), 0.7 * rms_off(noisy, flat));
}

TEST(Repeats, are_no_waves_across_rows) {
  for (const double period : {4, 5, 7}) {
    const auto waves = [&](int row) { return 0.008 * std::sin(row * 2 * 3.14159265 / period + 0.3); };
    const Points noisy = in_rows(waves, 0.0005);
    EXPECT_LT(rms_off(Ran(noisy).points, waves), 1.1 * rms_off(noisy, waves)) << period << " rows";
  }
}

}  // namespace
}  // namespace pointfair
