// SPDX-License-Identifier: Apache-2.0
#include "mesh/vertices.hpp"

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

// A point in the order of point::lies_before; of those at one place, the first comes first.
struct Placed {
  std::uint64_t x_y;
  std::uint32_t z, point;
  bool is_at(const Placed& other) const { return x_y == other.x_y && z == other.z; }
};
bool precedes(const Placed& a, const Placed& b) {
  if (a.x_y != b.x_y) return a.x_y < b.x_y;
  return a.z != b.z ? a.z < b.z : a.point < b.point;
}

}  // namespace

Vertices vertices_of(std::span<const Point> points, const ForEach& for_each) {
  std::vector<Placed> placed;
  placed.reserve(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    if (is_indexed(p)) placed.push_back({std::uint64_t(key_of(p.x)) << 32 | key_of(p.y), key_of(p.z), i});
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
