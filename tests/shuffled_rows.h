// SPDX-License-Identifier: Apache-2.0
// Clouds full of ties, and whether the stages of a backend give them the same results whatever the order of the rows.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "backend_runs.h"
#include "shapes.h"
#include "slow_tools.h"

namespace pointfair::shuffled_rows {

using shapes::Points;

struct NamedCloud {
  std::string name;
  Points points;
};

// Rounded to multiples of a power of two, every other zero negative.
inline Points on_a_grid(Points points, float step) {
  int zeros = 0;
  for (Point& p : points)
    for (float* c : {&p.x, &p.y, &p.z}) {
      *c = std::round(*c / step) * step;
      if (*c == 0) *c = zeros++ % 2 == 0 ? 0.0f : -0.0f;
    }
  return points;
}

// The unit square across an axis, on a lattice.
inline Points flat_lattice(int side, int axis) {
  Points points = shapes::scaled(shapes::flat_grid(side), 1.0f / 32);
  for (Point& p : points) std::swap((&p.x)[axis], p.z);
  return points;
}

inline Points with_doubles(Points points) {
  const std::size_t count = points.size();
  for (std::size_t i = 0; i < count / 2; ++i) points.push_back(points[i]);
  for (std::size_t i = 0; i < count / 4; ++i) points.push_back(points[i]);
  for (std::size_t i = 0; i < count / 5; ++i) points.push_back({0.5f, 0.25f, -0.125f});
  for (std::size_t i = 0; i < 50; ++i) points.push_back({0, 0.25f, i % 2 == 0 ? 0.0f : -0.0f});
  return points;
}

// A few points from which all others are equally far, to a few last bits or to the last.
inline Points from_afar(Points points) {
  for (const float distance : {3e3f, 1e6f, 1e9f})
    for (int corner = 0; corner < 8; ++corner)
      points.push_back({corner % 2 == 0 ? -distance : distance, corner / 2 % 2 == 0 ? -distance : distance,
                        corner / 4 == 0 ? -distance : distance});
  for (int i = 0; i < 5; ++i) points.push_back({1e4f + float(i % 2), 1e4f, 0});
  return points;
}

inline std::vector<NamedCloud> clouds(int count) {
  const Points surface = shapes::with_noise(shapes::waves(count), 0.01);
  std::vector<NamedCloud> result = {
      {"random", surface},
      {"lattice", on_a_grid(shapes::shifted(shapes::scaled(shapes::grid(17), 0.125f), {-1, -1, -1}), 0.125f)},
      {"quantised", on_a_grid(surface, 1.0f / 128)},
      {"doubled", with_doubles(surface)},
      {"from afar", from_afar(surface)},
      {"a lattice from afar", from_afar(on_a_grid(surface, 1.0f / 32))},
      {"distances that round to zero", shapes::scaled(on_a_grid(surface, 1.0f / 16), 1e-22f)}};
  for (int axis = 0; axis < 3; ++axis)
    result.push_back({"flat across axis " + std::to_string(axis), from_afar(flat_lattice(48, axis))});
  return slow_tools::some_of(result);
}

inline const std::vector<int> kEveryK = slow_tools::some_of(std::vector<int>{1, 5, 8, 16, 31, 32, 33, 64, 100});

// Bit for bit, row by row.
inline void expect_the_same(Backend& backend, const Points& points, const StageSettings& settings) {
  const StageResults plain = run(backend, points, settings);
  for (const std::uint64_t seed : {1, 2}) {
    const auto order = shapes::shuffle_order(points.size(), seed);
    const StageResults shuffled = run(backend, shapes::permuted(points, order), settings);
    EXPECT_EQ(difference(shuffled.normals, shapes::permuted(plain.normals, order)), "") << "normals";
    EXPECT_EQ(difference(shuffled.points, shapes::permuted(plain.points, order)), "") << "faired points";
    EXPECT_EQ(shuffled.counts.unmoved, plain.counts.unmoved);
    EXPECT_EQ(shuffled.counts.short_neighborhoods, plain.counts.short_neighborhoods);
  }
}

// Every kind of list, then sums over neighbourhoods of one radius.
inline void expect_the_same_lists(Backend& backend, const NamedCloud& cloud) {
  for (const int k : kEveryK) {
    SCOPED_TRACE(cloud.name + ", k " + std::to_string(k));
    StageSettings settings;
    settings.normals.sigma = 1e25f;  // what is far counts, too
    settings.neighbors = {k, 0, false, 0};
    expect_the_same(backend, cloud.points, settings);
    settings.neighbors = {k, 0.0625f, false, 0};
    settings.fairing.area_weight = AreaWeight::squared;
    expect_the_same(backend, cloud.points, settings);
    settings.neighbors = {k, k % 2 == 0 ? 0.25f : 0, true, 0.0625f};
    expect_the_same(backend, cloud.points, settings);
  }
}
inline void expect_the_same_sums(Backend& backend, const NamedCloud& cloud) {
  SCOPED_TRACE(cloud.name + ", one radius");
  StageSettings settings{.neighbors = {0, 0.07f, false, 0}, .frame = frame_over({0.1f, -0.2f, -0.3f}, 0.8f)};
  settings.normals.filter_rounds = 2;
  settings.normals.crease_angle = 25;
  settings.normals.flat_scale = 1.3f;
  settings.fairing.symmetric = true;
  settings.fairing.turn_angle = 45;
  for (const int iterations : {1, 3}) {
    settings.iterations = iterations;
    expect_the_same(backend, cloud.points, settings);
  }
}

// Points of few cells of the curve over expect_the_same_sums()' cube: pairs, some hundreds, and thousands at one place
// or beyond the cube, beside a surface.
inline NamedCloud in_few_cells(int count) {
  NamedCloud cloud{"in few cells", shapes::with_noise(shapes::waves(count), 0.01)};
  const std::size_t surface = cloud.points.size();
  constexpr float kStep = 0x1p-24f;  // a sixteenth of a cell, and exact near 0.5
  for (std::size_t i = 0; i < surface; i += 20) {
    const Point p = cloud.points[i];
    cloud.points.push_back({p.x + kStep, p.y, p.z});
    cloud.points.push_back({p.x, p.y - kStep, p.z + kStep});
  }
  for (const Point& p : shapes::cube(600)) {
    const auto near = [](float at, float c) { return at + kStep * std::round(6 * c); };
    cloud.points.push_back({near(0.5f, p.x), near(0.25f, p.y), near(0.125f, p.z)});
  }
  for (const Point& p : shapes::cube(count)) {
    cloud.points.push_back({1e9f + 8e3f * p.x, 2e9f + 8e3f * p.y, 4e9f + 8e3f * p.z});
    cloud.points.push_back({0.75f, 0.5f, 0.25f});
  }
  return cloud;
}

}  // namespace pointfair::shuffled_rows
