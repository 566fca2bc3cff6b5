// SPDX-License-Identifier: Apache-2.0
// The CUDA backend against the CPU backend, bit for bit. Skipped where no card can be used. POINTFAIR_TEST_POINTS=N
// cuts the clouds that both backends are compared on to N points, for compute-sanitizer.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <memory>

#include "backend_runs.h"
#include "runs.h"
#include "seam/sampling.hpp"
#include "shapes.h"
#include "slow_tools.h"

namespace pointfair {

inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

class CudaBackendTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
    cuda_ = make_cuda_backend(0);
    cpu_ = make_cpu_backend(0);
  }

  static std::vector<Point> cut(std::vector<Point> points) {
    points.resize(slow_tools::most_points(points.size()));
    return points;
  }

  void expect_same(const std::vector<Point>& whole, const StageSettings& settings, const char* what) {
    SCOPED_TRACE(what);
    const std::vector<Point> points = cut(whole);
    const StageResults cpu = run(*cpu_, points, settings);
    expect_equal(run(*cuda_, points, settings), cpu, "whole");
    if (points.size() > 1024 && !settings.frame)
      expect_equal(run(in_parts(points.size()), points, settings, true), cpu, "in parts");
  }
  static void expect_equal(const StageResults& cuda, const StageResults& cpu, const char* what) {
    SCOPED_TRACE(what);
    EXPECT_EQ(difference(cuda.normals, cpu.normals), "") << "normals";
    EXPECT_EQ(difference(cuda.points, cpu.points), "") << "faired points";
    EXPECT_EQ(cuda.counts.unmoved, cpu.counts.unmoved);
    EXPECT_EQ(cuda.counts.short_neighborhoods, cpu.counts.short_neighborhoods);
    EXPECT_EQ(cuda.held_back, cpu.held_back);
    EXPECT_EQ(cuda.solver.iterations, cpu.solver.iterations);
    EXPECT_EQ(cuda.solver.residual, cpu.solver.residual);
  }

  // A backend to which so many points come in three to eight parts.
  Backend& in_parts(std::size_t points) {
    std::size_t part = 1 << 20;
    while (part > 1024 && points <= 2 * part) part /= part > (1 << 15) ? 8 : 4;
    std::unique_ptr<Backend>& backend = in_parts_[part];
    if (backend == nullptr) backend = make_cuda_backend(0, {.upload_chunk = part});
    return *backend;
  }

  std::unique_ptr<Backend> cuda_, cpu_;
  std::map<std::size_t, std::unique_ptr<Backend>> in_parts_;
};

inline StageSettings with_neighbors(int k, float radius = 0, bool constraint = false, float reach = 0) {
  return {.neighbors = {k, radius, constraint, reach}};
}

inline std::vector<Point> noisy_sphere(int count, std::uint64_t seed, double noise) {
  std::vector<Point> points = shapes::sphere(count, seed);
  shapes::Random random(seed + 1);
  for (Point& p : points) {
    const float r = float(1 + noise * random.normal());
    p = {p.x * r, p.y * r, p.z * r};
  }
  return points;
}

inline std::vector<Point> lattice(int side) {
  std::vector<Point> points;
  for (int i = 0; i < side * side * side; ++i)
    points.push_back({float(i % side), float(i / side % side), float(i / side / side)});
  return points;
}

// One axis is warped so that density varies by the square of the ratio of its ends.
inline std::vector<Point> uneven_sphere(int count, double ratio) {
  std::vector<Point> points = noisy_sphere(count, 3, 0.001);
  for (Point& p : points) {
    const double size = 1 / (1 + (ratio - 1) * (double(p.z) + 1.1) / 2.2);
    p = {float(p.x * size), float(p.y * size), float(p.z * size)};
  }
  return points;
}

// What the default run does to radii, over lists too.
inline StageSettings with_filter_and_both_planes(StageSettings settings) {
  settings.normals.filter_rounds = 2;
  settings.normals.crease_angle = 25;
  settings.fairing.symmetric = true;
  settings.fairing.turn_angle = 45;
  settings.fairing.strength = 0.9f;
  return settings;
}

inline constexpr Method kOtherMethods[] = {Method::laplacian, Method::taubin, Method::hc_laplacian,
                                           Method::mls,       Method::wiener, Method::mollified};

inline StageSettings with_method(StageSettings settings, Method method) {
  settings.fairing.method = method;
  settings.fairing.strength = 0.63f;
  settings.fairing.similarity_sigma = 0.003f;
  return settings;
}

}  // namespace pointfair
