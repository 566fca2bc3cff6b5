// SPDX-License-Identifier: Apache-2.0
#include "mesh/vertices.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "mesh/blocks.hpp"

namespace pointfair {
namespace {

constexpr int kStepBits = 21, kPartBits = 6;  // an axis

bool are_at_one_place(const Point& a, const Point& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

// The lowest 21 bits, two places apart.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 32) & 0x1f00000000ffff;
  bits = (bits | bits << 16) & 0x1f0000ff0000ff;
  bits = (bits | bits << 8) & 0x100f00f00f00f00f;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
  return (bits | bits << 2) & 0x1249249249249249;
}

// The place along a Z-curve of 2^21 steps an axis over the cube on the corner `least`.
struct Curve {
  Point least;
  double steps;  // for each unit

  std::uint64_t place(const Point& p) const {
    const auto step = [&](float at, float from) {
      return spread(std::uint64_t(std::min((double(at) - double(from)) * steps, double((1 << kStepBits) - 1))));
    };
    return step(p.x, least.x) | step(p.y, least.y) << 1 | step(p.z, least.z) << 2;
  }
};

Curve curve_of(std::span<const Point> points) {
  Bounds bounds = kNoBounds;
  for (const Point& p : points)
    if (is_indexed(p)) include(bounds, p);
  if (bounds.valid == 0) return {};
  const double side = std::max(
      {double(bounds.max.x) - bounds.min.x, double(bounds.max.y) - bounds.min.y, double(bounds.max.z) - bounds.min.z});
  return {bounds.min, side > 0 ? double(1 << kStepBits) / side : 0};
}

struct Placed {
  std::uint64_t curve;
  std::uint32_t point;
};

// By the parts of the bounds, and in each by the curve; of those at one place, the first point comes first.
platform::LargeVector<Placed> along_curve(std::span<const Point> points, const ForEach& for_each) {
  const Curve curve = curve_of(points);
  const std::size_t parts = std::size_t(1) << 3 * kPartBits;
  ByNumber<Placed> by_part = sort_by_number<Placed>(
      points.size(), parts, for_each, [&](std::size_t first, std::size_t last, const auto& emit) {
        for (std::size_t i = first; i < last; ++i) {
          if (!is_indexed(points[i])) continue;
          const std::uint64_t place = curve.place(points[i]);
          emit(std::uint32_t(place >> 3 * (kStepBits - kPartBits)), Placed{place, std::uint32_t(i)});
        }
      });
  for_mesh_items(parts, for_each, [&](std::size_t part) {
    const std::span<Placed> its = by_part.of(part);
    std::ranges::sort(its, [&](const Placed& a, const Placed& b) {
      if (a.curve != b.curve) return a.curve < b.curve;
      const Point &p = points[a.point], &q = points[b.point];
      return std::tie(p.x, p.y, p.z, a.point) < std::tie(q.x, q.y, q.z, b.point);
    });
  });
  return std::move(by_part.items);
}

}  // namespace

platform::LargeVector<Point> Vertices::places(std::span<const Point> points, const ForEach& for_each) const {
  platform::LargeVector<Point> result(size());
  for_mesh_items(size(), for_each, [&](std::size_t v) { result[v] = points[first[v]]; });
  return result;
}

Vertices vertices_of(std::span<const Point> points, const ForEach& for_each) {
  const platform::LargeVector<Placed> placed = along_curve(points, for_each);
  const auto is_new = [&](std::size_t i) {
    return i == 0 || placed[i].curve != placed[i - 1].curve ||
           !are_at_one_place(points[placed[i].point], points[placed[i - 1].point]);
  };
  Vertices vertices;
  vertices.of_point.resize(points.size());
  for_mesh_blocks(points.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t) {
    std::fill(vertices.of_point.begin() + std::ptrdiff_t(first), vertices.of_point.begin() + std::ptrdiff_t(last),
              kNoVertex);
  });
  vertices.first.resize(placed.size());
  vertices.first.resize(
      place_in_order(placed.size(), for_each, is_new, [&](std::size_t i, std::size_t vertices_before) {
        const bool is_first = is_new(i);
        if (is_first) vertices.first[vertices_before] = placed[i].point;
        vertices.of_point[placed[i].point] = std::uint32_t(vertices_before) - (is_first ? 0 : 1);
      }));
  return vertices;
}

}  // namespace pointfair
