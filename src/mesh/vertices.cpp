// SPDX-License-Identifier: Apache-2.0
#include "mesh/vertices.hpp"

#include <algorithm>
#include <bit>
#include <numeric>

#include "mesh/blocks.hpp"

namespace pointfair {
namespace {

// A number that orders as the coordinate; -0 is 0.
std::uint32_t key_of(float coordinate) {
  const auto bits = std::bit_cast<std::uint32_t>(coordinate + 0.0f);
  return bits >> 31 != 0 ? ~bits : bits | 0x80000000u;
}

// A point in the order of vertices; of those at one place, the first comes first.
struct Placed {
  std::uint64_t curve, x_y;
  std::uint32_t z, point;
  bool is_at(const Placed& other) const { return x_y == other.x_y && z == other.z; }
};
bool precedes(const Placed& a, const Placed& b) {
  if (a.curve != b.curve) return a.curve < b.curve;
  if (a.x_y != b.x_y) return a.x_y < b.x_y;
  return a.z != b.z ? a.z < b.z : a.point < b.point;
}

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
      return spread(std::uint64_t(std::min((double(at) - double(from)) * steps, double((1 << 21) - 1))));
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
  return {bounds.min, side > 0 ? double(1 << 21) / side : 0};
}

}  // namespace

Vertices vertices_of(std::span<const Point> points, const ForEach& for_each) {
  const Curve curve = curve_of(points);
  std::vector<Placed> placed;
  placed.reserve(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    if (!is_indexed(p)) continue;
    placed.push_back({curve.place(p), std::uint64_t(key_of(p.x)) << 32 | key_of(p.y), key_of(p.z), i});
  }
  sort_in_parts(placed, for_each, precedes);
  Vertices vertices;
  vertices.of_point.resize(points.size());
  std::iota(vertices.of_point.begin(), vertices.of_point.end(), 0u);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (i == 0 || !placed[i].is_at(placed[i - 1])) vertices.in_order.push_back(placed[i].point);
    vertices.of_point[placed[i].point] = vertices.in_order.back();
  }
  return vertices;
}

}  // namespace pointfair
