// SPDX-License-Identifier: Apache-2.0
// Cuts a cloud in host memory into boxes of about as many points each, and finds all points of a region.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "backend.hpp"

namespace pointfair {

// Calls its second argument for each number below the first, many at once.
using ForEach = std::function<void(std::size_t, const std::function<void(std::size_t)>&)>;

// Space between two corners, the lower ends inside, the upper ones outside; infinite ends.
struct Cell {
  point::Vec3<float> min, max;
  bool contains(const Point& p) const {
    return p.x >= min.x && p.x < max.x && p.y >= min.y && p.y < max.y && p.z >= min.z && p.z < max.z;
  }
};

class Cut {
 public:
  // The cells fill space and do not overlap; there may be fewer than `pieces` where points are identical. Keeps
  // `points`. O(N) with one pass over the points for bounds, one for the cells.
  Cut(std::span<const Point> points, std::size_t pieces, const ForEach& for_each);

  struct Piece {
    Cell cell;
    Bounds core;  // of its points
  };
  const std::vector<Piece>& pieces() const { return pieces_; }
  const Bounds& bounds() const { return bounds_; }

  // The indices of all valid points in the region, ascending. Blocks of points that lie elsewhere, or inside, are not
  // read, so of a cloud in spatial order little is.
  void find(const point::Region& region, const ForEach& for_each, std::vector<std::uint32_t>& indices) const;

 private:
  void split(std::span<Point> sample, std::size_t pieces, const Cell& cell);

  std::span<const Point> points_;
  std::vector<Bounds> block_bounds_;
  std::vector<Piece> pieces_;
  Bounds bounds_;
};

inline bool is_valid(const Point& p) { return point::is_indexable(p.x, p.y, p.z); }
inline point::Vec3<float> to_vec3(const Point& p) { return {p.x, p.y, p.z}; }

// `bounds` and what lies within `halo` of them.
point::Region region_around(const Bounds& bounds, double halo);
void include(Bounds& bounds, const Point& p);
inline constexpr float kUnbounded = __builtin_inff();
inline constexpr Bounds kNoBounds{{kUnbounded, kUnbounded, kUnbounded}, {-kUnbounded, -kUnbounded, -kUnbounded}, 0};

}  // namespace pointfair
