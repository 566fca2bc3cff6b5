// SPDX-License-Identifier: Apache-2.0
// Coordinates and depths that take few values only, and what a run makes of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "estimate/coordinate_steps.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;
using Kind = CoordinateSteps::Kind;

constexpr double kStep = 1.0 / 256;  // exact, as are its multiples

Points rounded(Points points, double step) {
  for (Point& p : points)
    for (float* value : {&p.x, &p.y, &p.z}) *value = float(step * std::round(double(*value) / step));
  return points;
}

double squared_distance(const Point& a, const Point& b) { return std::pow(reference::distance(a, b), 2); }

// Of every n-th point, so that there are 300.
std::vector<std::size_t> sampled(const Points& points) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < 300; ++i) indices.push_back(i * points.size() / 300);
  return indices;
}
CoordinateSteps steps_of(const Points& points) {
  const NearestRows nearest(points.empty() ? 0 : 300, {}, [&points](std::size_t count, int neighbors) {
    std::vector<Point> rows;
    Points others = points;
    for (const std::size_t i : sampled(points)) {
      if (rows.size() == count * std::size_t(neighbors + 1)) break;
      const Point from = points[i];
      std::partial_sort(
          others.begin(), others.begin() + neighbors + 1, others.end(),
          [&from](const Point& a, const Point& b) { return squared_distance(from, a) < squared_distance(from, b); });
      rows.push_back(from);
      rows.insert(rows.end(), others.begin() + 1, others.begin() + neighbors + 1);
    }
    return rows;
  });
  const ForEach one_after_the_other = [](std::size_t count, const std::function<void(std::size_t)>& body) {
    for (std::size_t i = 0; i < count; ++i) body(i);
  };
  return coordinate_steps(steps_in_heads(nearest.heads(), nearest.samples(), one_after_the_other), nearest,
                          one_after_the_other);
}

// What a depth camera sees of a wall that leans away from it: disparities in whole steps, so that depths z lie
// kDisparity z^2 apart, with an error before rounding that is alike over windows of pixels.
constexpr double kDisparity = 0.004;
constexpr int kPixels = 160;
Points depth_frame(double turn) {
  Points points;
  shapes::Random random(4);
  constexpr int kWindow = 4, kWindows = kPixels / kWindow;
  std::vector<double> errors(std::size_t(kWindows) * kWindows);
  for (double& error : errors) error = 0.5 * kDisparity * random.normal();
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      const double u = double(column) / kPixels - 0.5, v = double(row) / kPixels - 0.5;
      const double disparity =
          (1 - 0.3 * u - 0.2 * v) / 2 + errors[std::size_t(row / kWindow) * kWindows + std::size_t(column / kWindow)];
      const double z = 1 / (kDisparity * std::round(disparity / kDisparity)), x = u * z;
      points.push_back(
          shapes::make_point(std::cos(turn) * x + std::sin(turn) * z, v * z, std::cos(turn) * z - std::sin(turn) * x));
    }
  return points;
}
// Of a frame that was not turned.
double mean_distance_to_wall(const Points& points) {
  return shapes::mean_error(points, [](Point p) { return p.z - 0.3 * p.x - 0.2 * p.y - 2; }) / std::sqrt(1.13);
}

TEST(CoordinateSteps, of_rounded_coordinates_are_found) {
  const Points sphere = shapes::with_noise(shapes::sphere(4000), 0.3 * kStep);
  for (const double step : {kStep, 4 * kStep, 16 * kStep}) {
    const CoordinateSteps found = steps_of(rounded(sphere, step));
    ASSERT_EQ(found.kind, Kind::grid) << step;
    for (const double at : found.at) EXPECT_NEAR(at, step, 0.01 * step);
  }
}

TEST(CoordinateSteps, of_depth_are_found_in_any_direction_and_widen_with_the_distance) {
  for (const double turn : {0.0, 0.6}) {
    const Points points = depth_frame(turn);
    const CoordinateSteps found = steps_of(points);
    ASSERT_EQ(found.kind, Kind::depth) << turn;
    const std::vector<std::size_t> indices = sampled(points);
    std::size_t right = 0;
    for (std::size_t i = 0; i < indices.size(); ++i) {
      const Point& p = points[indices[i]];
      const double depth = std::cos(turn) * p.z + std::sin(turn) * p.x;
      right += std::abs(found.at[i] / (kDisparity * depth * depth) - 1) < 0.1;
    }
    EXPECT_GT(double(right), 0.95 * double(indices.size())) << turn;
  }
}

TEST(CoordinateSteps, are_not_found_in_what_is_exact_or_noisy) {
  Points lattice;
  for (int i = 0; i < 64; ++i)
    for (int j = 0; j < 64; ++j) lattice.push_back(shapes::make_point(i, j, 0));
  Points faces = shapes::plane(3000);
  for (Point& p : faces)
    if (p.x > 0.5f) p = {0.5f, p.y, p.x - 0.5f};
  Points profiles = shapes::plane(4000);  // of a scanner that is driven past: planes of their own, ever wider apart
  for (Point& p : profiles) p.y = float(std::pow(std::round(20 * p.y), 1.5)) / 20, p.z = 0.02f * std::sin(9 * p.x);
  const Points sphere = shapes::sphere(4000);
  for (const Points& points :
       {lattice, faces, profiles, sphere, shapes::with_noise(sphere, 0.01), shapes::plane(3000), Points{}})
    EXPECT_EQ(steps_of(points).kind, Kind::none);
}

TEST(CoordinateSteps, do_not_depend_on_where_the_cloud_lies) {
  Points points = depth_frame(0);
  for (Point& p : points)  // differences stay exact
    for (float* value : {&p.x, &p.y, &p.z}) *value = float(std::round(double(*value) * 65536) / 65536);
  const CoordinateSteps here = steps_of(points);
  for (Point& p : points) p.x += 8, p.z -= 16;
  const CoordinateSteps there = steps_of(points);
  EXPECT_EQ(here.kind, there.kind);
  EXPECT_EQ(here.at, there.at);
}

double mean_distance_to_sphere(const Points& points) {
  return shapes::mean_error(points, [](Point p) { return reference::length(reference::to_vec(p)) - 1; });
}
Points denoised(const Points& points) { return Ran(points).points; }

// Where steps were not known, rounding to three sigmas and more left the input as it was.
// Points of a wall then lie on two or three values, like on the sides of a thin part.
TEST(CoordinateSteps, of_a_wall_along_the_axes_make_no_sheets) {
  Points points = shapes::plane(20000);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].z = 0.3f;
    if (i % 2 == 1) points[i] = {0.4f, points[i].y, points[i].x};
  }
  points = rounded(shapes::with_noise(points, kStep / 3), kStep);
  const auto distance = [](const Points& of) {
    double sum = 0;
    for (std::size_t i = 0; i < of.size(); ++i)
      sum += std::abs(i % 2 == 1 ? double(of[i].x) - 0.4f : double(of[i].z) - 0.3f);
    return sum;
  };
  EXPECT_LT(distance(denoised(points)), 0.5 * distance(points));
}

// Without noise, a level camera's rows on the floor are levels that widen with the square of the distance, and a wall
// that faces it is exact; so are the faces of a cube.
TEST(CoordinateSteps, are_not_found_in_flat_faces_without_noise) {
  Points room;
  constexpr int kRows = 120;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kRows; ++column) {
      const double u = (column + 0.5) / kRows - 0.5, v = (row + 0.5) / kRows - 0.5,
                   depth = std::min(3.0, 0.6 / std::max(v, 0.01));
      room.push_back(shapes::make_point(u * depth, v * depth, depth));
    }
  for (const Points& points : {room, shapes::cube(300), shapes::cube(1500)}) {
    EXPECT_EQ(steps_of(points).kind, Kind::none);
    const Points after = denoised(points);
    for (std::size_t i = 0; i < points.size(); ++i) ASSERT_LT(squared_distance(after[i], points[i]), 1e-10) << i;
  }
}

TEST(CoordinateSteps, of_any_width_leave_a_run_no_cliff) {
  constexpr int kPoints = 30000;
  const double spacing = std::sqrt(4 * 3.14159265 / kPoints), sigma = 0.15 * spacing;
  const Points noisy = shapes::with_noise(shapes::sphere(kPoints), sigma);
  double before = mean_distance_to_sphere(denoised(noisy));
  for (const double width : {0.5, 1.0, 2.0, 3.0, 4.0, 6.0}) {
    const Points input = rounded(noisy, width * sigma);
    const double left = mean_distance_to_sphere(denoised(input)), noise = mean_distance_to_sphere(input);
    EXPECT_LT(left, 0.7 * noise) << width;
    EXPECT_LT(left, 1.8 * before + 0.05 * noise) << width;
    before = left;
  }
}

TEST(CoordinateSteps, of_depth_leave_a_run_less_than_a_third) {
  const Points frame = depth_frame(0);
  EXPECT_LT(mean_distance_to_wall(denoised(frame)), mean_distance_to_wall(frame) / 3);
}

}  // namespace
}  // namespace pointfair
