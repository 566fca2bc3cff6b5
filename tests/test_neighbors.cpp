// SPDX-License-Identifier: Apache-2.0
// Neighbour lists of the CPU backend: exact set and order, against brute force and nanoflann, on every instruction set
// that this processor has.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <nanoflann.hpp>
#include <string>
#include <vector>

#include "backend_runs.h"
#include "cpu/index.h"
#include "cpu/kernels.h"
#include "reference.h"
#include "seam/sampling.hpp"
#include "shapes.h"

#if defined(__x86_64__)
namespace pointfair::cpu {
namespace sse2 {
extern const Kernels kKernels;
}
namespace avx2 {
extern const Kernels kKernels;
}
namespace avx512 {
extern const Kernels kKernels;
}
}  // namespace pointfair::cpu
#endif

namespace pointfair {
namespace {

using cpu::Index;
using shapes::Points;

std::vector<const cpu::Kernels*> available_kernels() {
#if defined(__x86_64__)
  std::vector<const cpu::Kernels*> result = {&cpu::sse2::kKernels};
  if (__builtin_cpu_supports("avx2")) result.push_back(&cpu::avx2::kKernels);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512vl"))
    result.push_back(&cpu::avx512::kKernels);
  return result;
#else
  return {&cpu::best_kernels()};
#endif
}

// Lists of all points in upload order and numbering, as the neighbour stage computes them.
std::vector<reference::List> all_lists(const cpu::SpatialIndex& index, const cpu::Kernels& kernels, std::size_t points,
                                       int k, float squared_limit) {
  const cpu::IndexView view = index.view();
  std::vector<reference::List> lists(points);
  std::vector<Index> block(std::size_t(k) * cpu::kLeafSize);
  for (Index leaf = 0; leaf < view.leaves; ++leaf) {
    kernels.nearest(view, leaf, k, squared_limit, block.data());
    for (Index lane = 0; lane < Index(cpu::kLeafSize); ++lane) {
      const Index position = leaf * cpu::kLeafSize + lane;
      for (int s = 0; s < k && position < view.points; ++s) {
        const Index found = block[std::size_t(s) * cpu::kLeafSize + lane];
        if (found != point::kNoNeighbor) lists[view.original[position]].push_back(view.original[found]);
      }
    }
  }
  return lists;
}

void expect_exact_lists(const Points& points, int k, float radius = 0, std::size_t step = 1) {
  const float limit = radius > 0 ? radius * radius : std::numeric_limits<float>::max();
  std::vector<reference::List> expected(points.size());
  for (std::size_t i = 0; i < points.size(); i += step) {
    if (!reference::is_valid(points[i])) continue;
    expected[i] = reference::nearest(points, i, std::size_t(k));
    std::erase_if(expected[i], [&](auto j) { return reference::squared_distance(points[i], points[j]) > limit; });
  }
  for (const cpu::Kernels* kernels : available_kernels()) {
    cpu::MemoryMeter meter;
    cpu::SortSpace space(meter);
    cpu::SpatialIndex index(meter);
    index.build(points, {}, std::nullopt, space, *kernels, {});
    const auto found = all_lists(index, *kernels, points.size(), k, limit);
    for (std::size_t i = 0; i < points.size(); i += step)
      ASSERT_EQ(found[i], expected[i]) << "point " << i << ", k " << k << ", radius " << radius << ", "
                                       << kernels->name;
  }
}

constexpr int kEveryK[] = {1, 2, 3, 5, 8, 16, 32, 64, 512};

TEST(Neighbors, are_exact_for_every_k_on_a_noisy_surface) {
  const Points points = shapes::with_noise(shapes::waves(1500), 0.01);
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_where_every_distance_ties) {
  for (const int k : kEveryK) expect_exact_lists(shapes::grid(9), k);
}

TEST(Neighbors, are_exact_where_distances_differ_in_their_last_bits) {
  Points points = shapes::sphere(600);  // unit radius as far as rounding allows
  for (int i = 0; i < 20; ++i) points.push_back(shapes::make_point(1e-7 * i, -1e-7 * i, 0));
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

// Along a spiral about the query every candidate is nearer than all before, and each is worth a place in the list for a
// while: more than a walk has numbers for.
TEST(Neighbors, at_the_centre_of_a_spiral_are_exact) {
  for (const double turn : {6.28, -6.28}) {
    Points points = {{0, 0, 0}};
    for (int i = 0; i < 4000; ++i) {
      const double t = i / 4000.0;
      points.push_back(shapes::make_point((1 - t / 2) * std::cos(turn * t), (1 - t / 2) * std::sin(turn * t), 0));
    }
    for (const int k : {8, 16, 32, 64}) expect_exact_lists(points, k, 0, 20);
  }
}

TEST(Neighbors, of_identical_points_are_the_first_by_index) {
  for (const int k : {1, 5, 8, 32, 64}) expect_exact_lists(shapes::identical(300), k);
}

TEST(Neighbors, are_exact_when_many_points_are_doubles) {
  Points points = shapes::waves(400);
  points.insert(points.end(), points.begin(), points.end());
  points.insert(points.end(), points.begin(), points.begin() + 300);
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_at_1000_to_1_density) {
  const Points points = shapes::uneven(1500, 1000);
  for (const int k : {8, 32, 64}) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_beside_a_stray_point) {
  for (const float distance : {1e3f, 1e6f, 1e17f})
    for (const int k : {8, 32, 64}) expect_exact_lists(shapes::with_stray(shapes::waves(700), distance), k);
}

TEST(Neighbors, do_not_include_invalid_points) {
  const Points points = shapes::with_invalid(shapes::sphere(900), 5);
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

TEST(Neighbors, are_all_others_when_there_are_fewer_than_k) {
  for (int count = 0; count <= 40; ++count)
    for (const int k : {1, 8, 16, 33}) expect_exact_lists(shapes::sphere(count), k);
}

TEST(Neighbors, are_exact_for_every_number_of_points_around_a_leaf_and_a_node) {
  for (const int around : {16, 256, 4096})
    for (const int count : {around - 1, around, around + 1}) expect_exact_lists(shapes::cube(count), 8, 0, 13);
}

TEST(Neighbors, within_a_radius_are_the_nearest_that_lie_in_it) {
  const Points points = shapes::with_noise(shapes::waves(1500), 0.01);
  for (const float radius : {1e-6f, 0.02f, 0.05f, 0.2f, 3.0f})
    for (const int k : {1, 8, 32, 64}) expect_exact_lists(points, k, radius);
}

TEST(Neighbors, at_exactly_the_radius_belong_to_it) {
  for (const float radius : {1.0f, 2.0f, 3.0f}) expect_exact_lists(shapes::grid(7), 64, radius);
}

TEST(Neighbors, on_a_line_or_far_from_zero_or_at_tiny_scale_are_exact) {
  expect_exact_lists(shapes::line(900), 16);
  expect_exact_lists(shapes::shifted(shapes::waves(900), {4e5f, -5e6f, 300}), 16);  // rounded: full of ties
  expect_exact_lists(shapes::scaled(shapes::waves(900), 1e-15f), 16);
  expect_exact_lists(shapes::scaled(shapes::waves(900), 1e15f), 16);
}

struct NanoflannPoints {
  const Points& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const { return (&points[i].x)[axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

TEST(Neighbors, have_the_distances_that_nanoflann_finds) {
  using Metric = nanoflann::L2_Simple_Adaptor<float, NanoflannPoints>;
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<Metric, NanoflannPoints, 3, std::uint32_t>;
  constexpr int kCount = 30000, kNeighbors = 17;
  const Points points = shapes::with_noise(shapes::uneven(kCount, 50), 0.003);
  const NanoflannPoints adaptor{points};
  Tree tree(3, adaptor);
  cpu::MemoryMeter meter;
  cpu::SortSpace space(meter);
  cpu::SpatialIndex index(meter);
  index.build(points, {}, std::nullopt, space, cpu::best_kernels(), {});
  const auto found =
      all_lists(index, cpu::best_kernels(), points.size(), kNeighbors, std::numeric_limits<float>::max());
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::uint32_t ids[kNeighbors + 1];
    float squared[kNeighbors + 1];  // the point itself comes first
    ASSERT_EQ(tree.knnSearch(&points[i].x, kNeighbors + 1, ids, squared), std::size_t(kNeighbors + 1));
    for (std::size_t s = 0; s < kNeighbors; ++s)
      ASSERT_EQ(reference::squared_distance(points[i], points[found[i][s]]), squared[s + 1]) << "point " << i;
  }
}

constexpr int kLargestSample = 1024;

// The row that sample_neighborhoods promises for a query with the largest k, by brute force; invalid places are NaN.
std::vector<Point> expected_row(const Points& points, std::uint32_t query) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<Point> row;
  if (reference::is_valid(points[query])) {
    row.push_back(points[query]);
    for (const std::uint32_t j : reference::nearest(points, query, kLargestSample)) row.push_back(points[j]);
  }
  row.resize(kLargestSample + 1, Point{nan, nan, nan});
  return row;
}

bool same_or_both_nan(Point a, Point b) {
  return (std::isnan(a.x) && std::isnan(b.x)) || (a.x == b.x && a.y == b.y && a.z == b.z);
}

TEST(SampleNeighborhoods, returns_each_query_and_its_nearest_in_order) {
  for (const Points& points :
       {shapes::with_noise(shapes::waves(2000), 0.01), shapes::with_invalid(shapes::sphere(500), 4), shapes::grid(8),
        shapes::sphere(5), shapes::identical(40)}) {
    const std::unique_ptr<Backend> backend = make_cpu_backend(2);
    backend->upload(points, IndexOrder::fastest);
    backend->build_index(0, {}, {});
    std::vector<std::uint32_t> queries;
    std::vector<std::vector<Point>> expected;
    for (std::uint32_t i = 0; i < points.size(); i += 3) {
      queries.push_back(std::uint32_t(points.size()) - 1 - i);
      expected.push_back(expected_row(points, queries.back()));
    }
    for (const int k : {1, 6, 24, 100, kLargestSample}) {
      const std::size_t width = std::size_t(k) + 1;
      std::vector<Point> rows(queries.size() * width);
      backend->sampling().sample_neighborhoods(queries, k, rows);
      for (std::size_t i = 0; i < rows.size(); ++i)
        ASSERT_TRUE(same_or_both_nan(rows[i], expected[i / width][i % width]))
            << "place " << i % width << " of query " << queries[i / width] << ", k " << k;
    }
  }
}

// Upload indices of the valid points in the order of a cube's curve.
std::vector<Index> order_along(const Points& points, const Frame& frame, const cpu::Kernels& kernels,
                               std::span<const Index> originals = {}) {
  cpu::MemoryMeter meter;
  cpu::SpatialIndex index(meter);
  cpu::SortSpace space(meter);
  index.build(points, originals, frame, space, kernels, {});
  const auto order = index.originals().first(index.view().points);
  return {order.begin(), order.end()};
}

Points hard_cloud() {
  Points points = shapes::with_invalid(shapes::with_noise(shapes::waves(6000), 0.01), 50);
  for (std::size_t i = 0; i < 500; ++i) points[7 * i + 3] = points[11];
  for (std::size_t i = 0; i < 40; ++i) points[13 * i] = {float(i) * 1e4f, -1e9f, float(i % 3)};
  return points;
}
constexpr Point kLower{-0.2f, 0.1f, -0.3f};  // of a cube that neither holds all nor all valid points
constexpr float kWidth = 0.9f;
const Frame kFrame = frame_over(kLower, kWidth);

// Shuffled, in parts, at any length of the sorts' runs: the same order.
TEST(CurveOrder, of_a_part_is_that_of_the_whole) {
  const Points points = hard_cloud();
  for (const cpu::Kernels* kernels : available_kernels()) {
    const std::vector<Index> whole = order_along(points, kFrame, *kernels);
    EXPECT_EQ(whole, order_along(points, kFrame, cpu::best_kernels())) << kernels->name;
    for (const std::size_t step : {1, 2, 7}) {
      Points part;
      std::vector<Index> originals, expected;
      for (const std::uint32_t i : shapes::shuffle_order(points.size(), 3)) {
        if (i % step != 0) continue;
        part.push_back(points[i]);
        originals.push_back(i);
      }
      for (const Index i : whole)
        if (i % step == 0) expected.push_back(i);
      EXPECT_EQ(order_along(part, kFrame, *kernels, originals), expected) << kernels->name << ", every " << step;
    }
  }
}

// By the definition: cells of 2^20 steps an axis, of which two digits make the place on the curve, ties by index.
TEST(CurveOrder, is_by_first_digit_then_by_second_then_by_index) {
  const Points points = hard_cloud();
  const auto steps_of = [](Point p) {
    const auto step = [](float v, float origin) {
      const double u = double((v - origin) * (1 / kWidth)), margin = 1 << 16;
      const double at = u < 0   ? margin / (1 - u)
                        : u > 1 ? (1 << 20) - margin / u
                                : margin + u * ((1 << 20) - 2 * margin);
      return std::min(at, (1 << 20) - 1.0);
    };
    return std::array{step(p.x, kLower.x), step(p.y, kLower.y), step(p.z, kLower.z)};
  };
  const auto whole_steps = [&](Point p) {
    const auto s = steps_of(p);
    return std::array{int(s[0]), int(s[1]), int(s[2])};
  };
  const std::vector<Index> order = order_along(points, kFrame, cpu::best_kernels());
  // Points of one cell of the first digit, and of one cell of the second, follow each other without a gap.
  for (const int shift : {10, 0}) {
    std::map<std::array<int, 3>, std::pair<std::size_t, std::size_t>> cells;  // first and last place
    std::map<std::array<int, 3>, std::size_t> counts;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto exact = steps_of(points[order[i]]);
      if (std::any_of(exact.begin(), exact.end(), [](double s) { return std::abs(s - std::round(s)) < 0.2; }))
        continue;  // may round to the cell beside it in single precision
      auto cell = whole_steps(points[order[i]]);
      for (int& c : cell) c >>= shift;
      const auto [place, is_new] = cells.try_emplace(cell, i, i);
      place->second.second = i;
      ++counts[cell];
    }
    std::size_t shared = 0;
    for (const auto& [cell, ends] : cells) {
      shared += counts[cell] > 1;
      for (std::size_t i = ends.first; i <= ends.second; ++i) {
        const auto at = steps_of(points[order[i]]);
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_GE(at[axis], double(cell[axis] << shift) - 0.2);
          EXPECT_LE(at[axis], double((cell[axis] + 1) << shift) + 0.2);
        }
      }
    }
    EXPECT_GT(shared, 0u);
  }
  for (std::size_t i = 1; i < order.size(); ++i) {
    const Point a = points[order[i - 1]], b = points[order[i]];
    const bool identical = a.x == b.x && a.y == b.y && a.z == b.z;
    EXPECT_TRUE(!identical || order[i - 1] < order[i]) << i;
  }
}

// A cell of the first digit touches the next one: that is what makes it a Hilbert curve.
TEST(CurveOrder, goes_from_each_cell_to_one_beside_it) {
  constexpr int kSide = 16;
  Points points;  // a point in each of 16^3 cells in a corner of the cube, which the curve fills before it leaves
  for (const std::uint32_t i : shapes::shuffle_order(kSide * kSide * kSide, 5)) {
    const auto place = [](std::uint32_t cell) { return (float(cell) + 0.5f - 64) / 896; };  // 64 steps are outside
    points.push_back({place(i % kSide), place(i / kSide % kSide), place(i / kSide / kSide)});
  }
  for (Point& p : points) p = {p.x + 64.0f / 896, p.y + 64.0f / 896, p.z + 64.0f / 896};
  const std::vector<Index> order = order_along(points, frame_over({0, 0, 0}, 1), cpu::best_kernels());
  const float step = 1.0f / 896;
  for (std::size_t i = 1; i < order.size(); ++i) {
    const Point a = points[order[i - 1]], b = points[order[i]];
    EXPECT_NEAR(std::abs(a.x - b.x) + std::abs(a.y - b.y) + std::abs(a.z - b.z), step, step / 100) << i;
  }
}

TEST(CloudSample, bounds_hold_exactly_the_valid_points) {
  for (const Points& points :
       {shapes::with_invalid(shapes::sphere(500), 4), shapes::with_stray(shapes::plane(50), 1e6f)}) {
    Bounds expected{{1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, 0};
    for (const Point p : points) {
      if (!reference::is_valid(p)) continue;
      expected.min = {std::min(expected.min.x, p.x), std::min(expected.min.y, p.y), std::min(expected.min.z, p.z)};
      expected.max = {std::max(expected.max.x, p.x), std::max(expected.max.y, p.y), std::max(expected.max.z, p.z)};
      ++expected.valid;
    }
    const std::unique_ptr<Backend> backend = make_cpu_backend(2);
    backend->upload(points, IndexOrder::fastest);
    const Bounds found = backend->sampling().sample_cloud(1).bounds;
    EXPECT_EQ(found.valid, expected.valid);
    EXPECT_TRUE(same_or_both_nan(found.min, expected.min));
    EXPECT_TRUE(same_or_both_nan(found.max, expected.max));
  }
}

}  // namespace
}  // namespace pointfair
