// SPDX-License-Identifier: Apache-2.0
// The order along the curve of sums over neighbourhoods of one radius, on every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "backend_runs.h"
#include "cpu/index.h"
#include "every_kernel.h"
#include "reference.h"
#include "shapes.h"

namespace pointfair {
namespace {

using cpu::Index;
using shapes::Points;

// The valid points in the order of a frame's curve.
Points order_along(const Points& points, const Frame& frame, const cpu::Kernels& kernels) {
  cpu::MemoryMeter meter;
  cpu::SpatialIndex index(meter);
  cpu::SortSpace space(meter);
  index.build(points, {}, frame, space, kernels, {});
  Points ordered;
  for (const Index original : index.originals().first(index.view().points)) ordered.push_back(points[original]);
  return ordered;
}

bool same(const Points& a, const Points& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](Point p, Point q) { return p.x == q.x && p.y == q.y && p.z == q.z; });
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
    const Points whole = order_along(points, kFrame, *kernels);
    EXPECT_TRUE(same(whole, order_along(points, kFrame, cpu::best_kernels()))) << kernels->name;
    for (const int step : {1, 2, 7}) {
      const auto is_in_part = [step](Point p) { return int(std::abs(p.x) * 1e4f) % step == 0; };
      Points part, expected;
      for (const Point p : shapes::permuted(points, shapes::shuffle_order(points.size(), 3)))
        if (is_in_part(p)) part.push_back(p);
      std::copy_if(whole.begin(), whole.end(), std::back_inserter(expected), is_in_part);
      EXPECT_TRUE(same(order_along(part, kFrame, *kernels), expected)) << kernels->name << ", every " << step;
    }
  }
}

// More different points than one leaf, and than any other number of the sort, in one cell, identical ones among them.
TEST(CurveOrder, in_one_cell_is_by_position) {
  Points points = shapes::with_noise(shapes::waves(300), 0.01);
  for (const Point p : shapes::cube(30000)) points.push_back({1e9f + 2e3f * p.x, 2e9f + 4e3f * p.y, 1e8f * p.z + 4e9f});
  for (std::size_t i = 0; i < 3000; ++i) points[400 + 9 * i] = points[301];
  const Points far(points.begin() + 300, points.end());
  Points expected = far;
  std::sort(expected.begin(), expected.end(), reference::lies_before);
  for (const std::uint64_t seed : {1, 2}) {
    const Points shuffled = shapes::permuted(points, shapes::shuffle_order(points.size(), seed));
    Points found = order_along(shuffled, kFrame, cpu::best_kernels());
    std::erase_if(found, [](Point p) { return p.x < 1e8f; });
    EXPECT_TRUE(same(found, expected)) << seed;
  }
}

// By the definition: cells of 2^20 steps an axis, of which two digits make the place on the curve.
TEST(CurveOrder, is_by_first_digit_then_by_second) {
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
  const Points order = order_along(points, kFrame, cpu::best_kernels());
  // Points of one cell of the first digit, and of one cell of the second, follow each other without a gap.
  for (const int shift : {10, 0}) {
    std::map<std::array<int, 3>, std::pair<std::size_t, std::size_t>> cells;  // first and last place
    std::map<std::array<int, 3>, std::size_t> counts;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto exact = steps_of(order[i]);
      if (std::any_of(exact.begin(), exact.end(), [](double s) { return std::abs(s - std::round(s)) < 0.2; }))
        continue;  // may round to the cell beside it in single precision
      auto cell = whole_steps(order[i]);
      for (int& c : cell) c >>= shift;
      const auto [place, is_new] = cells.try_emplace(cell, i, i);
      place->second.second = i;
      ++counts[cell];
    }
    std::size_t shared = 0;
    for (const auto& [cell, ends] : cells) {
      shared += counts[cell] > 1;
      for (std::size_t i = ends.first; i <= ends.second; ++i) {
        const auto at = steps_of(order[i]);
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_GE(at[axis], double(cell[axis] << shift) - 0.2);
          EXPECT_LE(at[axis], double((cell[axis] + 1) << shift) + 0.2);
        }
      }
    }
    EXPECT_GT(shared, 0u);
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
  const Points order = order_along(points, frame_over({0, 0, 0}, 1), cpu::best_kernels());
  const float step = 1.0f / 896;
  for (std::size_t i = 1; i < order.size(); ++i) {
    const Point a = order[i - 1], b = order[i];
    EXPECT_NEAR(std::abs(a.x - b.x) + std::abs(a.y - b.y) + std::abs(a.z - b.z), step, step / 100) << i;
  }
}

}  // namespace
}  // namespace pointfair
