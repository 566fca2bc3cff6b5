// SPDX-License-Identifier: Apache-2.0
// The order along the curve of sums over neighbourhoods of one radius, on every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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

}  // namespace
}  // namespace pointfair
