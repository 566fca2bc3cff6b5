// SPDX-License-Identifier: Apache-2.0
// Batches of clouds, and what they are computed with.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "shapes.h"
#include "slow_tools.h"

namespace pointfair::shapes {

struct Clouds {
  std::vector<Point> points;
  std::vector<std::uint64_t> offsets{0};

  void add(int count, float scale, float x, float noise = 0.01f) {
    Random random(std::uint64_t(count) + 7);
    for (const Point& p : sphere(count, std::uint64_t(count) + 1)) {
      const float r = scale * float(1 + noise * random.normal());
      points.push_back({x + p.x * r, p.y * r, p.z * r});
    }
    end();
  }
  void end() { offsets.push_back(points.size()); }
  void add_with_invalid(int count) {
    add(count, 1, 0);
    for (std::size_t i = 0; i < std::size_t(count); i += 7)
      points[offsets.end()[-2] + i].y = i % 2 == 0 ? std::numeric_limits<float>::quiet_NaN() : 1e30f;
  }
  // Two sheets, as of a thin part.
  void add_sheets(int count, float gap, float noise) {
    Random random(std::uint64_t(count) + 9);
    for (int i = 0; i < count; ++i)
      points.push_back({float(random.uniform()), float(random.uniform()),
                        (i % 2 == 0 ? gap : 0.0f) + float(noise * random.normal())});
    end();
  }
  // Noisier from one side to the other.
  void add_slope(int count, float noise) {
    Random random(std::uint64_t(count) + 11);
    for (int i = 0; i < count; ++i) {
      const float x = float(random.uniform()), y = float(random.uniform());
      points.push_back({x, y, float(0.1 * std::sin(6 * x) + noise * (0.3 + 2 * x) * random.normal())});
    }
    end();
  }
  std::span<const Point> cloud(std::size_t i) const {
    return std::span(points).subspan(offsets[i], offsets[i + 1] - offsets[i]);
  }
  std::size_t count() const { return offsets.size() - 1; }
};

// Clouds that lie in each other, of every size about the leaves and groups of a tree; one in one place, one of a line,
// one with invalid points.
inline Clouds mixed_clouds() {
  Clouds clouds;
  for (const int size : {0, 1, 2, 5, 31, 32, 33, 1000, 1023, 1024, 1025, 2048, 3000, 0, 7777, 10240})
    clouds.add(int(slow_tools::most_points(std::size_t(size))), size % 3 == 0 ? 0.3f : 1.0f,
               size % 2 == 0 ? 0.0f : 0.4f);
  for (int i = 0; i < 500; ++i) clouds.points.push_back({1, 2, 3});
  clouds.end();
  for (int i = 0; i < 500; ++i) clouds.points.push_back({float(i), 0, 0});
  clouds.end();
  clouds.add_with_invalid(900);
  clouds.add(int(slow_tools::most_points(40000)), 1, 0);  // too large to be computed with the others
  clouds.add(700, 1, 0);
  return clouds;
}

// Of which each has another noise, or none, or shows it otherwise.
inline Clouds clouds_with_estimates() {
  Clouds clouds;
  clouds.add(0, 1, 0);
  for (const float noise : {0.0f, 0.001f, 0.003f, 0.01f, 0.03f, 0.1f}) clouds.add(1024, 1, 0, noise);
  clouds.add(1, 1, 0);
  clouds.add(20, 1, 0);
  clouds.add(1500, 100, 30);
  clouds.add(2500, 1e-3f, 0, 0.02f);
  clouds.add_sheets(2000, 0.08f, 0.004f);
  clouds.add_slope(1024, 0.01f);
  clouds.add_slope(3000, 0.02f);
  for (int i = 0; i < 300; ++i) clouds.points.push_back({1, 2, 3});
  clouds.end();
  for (int i = 0; i < 40; ++i) clouds.points.push_back({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  clouds.end();
  for (int i = 0; i < 32 * 32; ++i)  // rounded to a grid
    clouds.points.push_back({float(i % 32), float(i / 32), float(i * 7 % 3)});
  clouds.end();
  clouds.add_with_invalid(900);
  return clouds;
}

// Where something follows from each cloud, and where all is given, always with sums within a radius.
inline std::vector<Params> params_with_estimates() {
  return {{},
          {.iterations = 1},
          {.iterations = 3},
          {.noise = 0.02},
          {.outliers = Outliers::off},
          {.outliers = Outliers::move},
          {.radius = Length(3, Length::Unit::spacing)},
          {.radius = 0.2, .min_neighbors = 40},
          {.normal_filter = NormalFilter::off},
          {.flat_scale = 1, .relaxation = 0.7},
          {.radius = 0.15, .min_neighbors = 0, .outliers = Outliers::off, .iterations = 1},
          {.area_weight = AreaWeight::squared, .displacement_limit = Length(1, Length::Unit::percent)}};
}

inline void expect_bits_of_single_runs(Pipeline& many, Pipeline& single, const Clouds& clouds, const Params& params,
                                       const std::string& what) {
  std::vector<Point> result(clouds.points.size());
  many.run_many(clouds.points, clouds.offsets, params, result);
  for (std::size_t i = 0; i < clouds.count(); ++i) {
    const std::vector<Point> expected = result_of(single, clouds.cloud(i), params);
    EXPECT_TRUE(expected.empty() ||
                std::memcmp(expected.data(), result.data() + clouds.offsets[i], expected.size() * sizeof(Point)) == 0)
        << what << ", cloud " << i << " of " << expected.size();
  }
}

}  // namespace pointfair::shapes
