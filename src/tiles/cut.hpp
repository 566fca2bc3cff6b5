// SPDX-License-Identifier: Apache-2.0
// Cuts a cloud in host memory into tiles of about as many points each, and finds all points of a region.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "point/region.h"
#include "seam/cloud_sample.hpp"

namespace pointfair {

using point::Cell;

// Cells of as many points of the sample each, which fill space. There may be fewer than `cells` where points are
// identical. Reorders the sample.
std::vector<Cell> cells_of(std::span<Point> sample, std::size_t cells);

class Cut {
 public:
  // The cells of the tiles fill space and do not overlap; there may be fewer than `tiles` where points are identical.
  // Keeps `points`. O(N) with one pass over the points for bounds, one for the cells.
  Cut(std::span<const Point> points, std::size_t tiles, const ForEach& for_each);

  struct Tile {
    Cell cell;
    Bounds core;  // of its points
  };
  const std::vector<Tile>& tiles() const { return tiles_; }
  const Bounds& bounds() const { return bounds_; }

  // The indices of all valid points in the region, ascending. Blocks of points that lie elsewhere, or inside, are not
  // read, so of a cloud in spatial order little is.
  void find(const point::Region& region, const ForEach& for_each, std::vector<std::uint32_t>& indices) const;

 private:
  std::span<const Point> points_;
  std::vector<Bounds> block_bounds_;
  std::vector<Tile> tiles_;
  Bounds bounds_;
};

}  // namespace pointfair
