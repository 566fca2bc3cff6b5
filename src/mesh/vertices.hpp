// SPDX-License-Identifier: Apache-2.0
// Which points are one vertex.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "seam/cloud_sample.hpp"

namespace pointfair {

struct Vertices {
  std::vector<std::uint32_t> of_point;  // the first point at its place; a point that is not indexed: itself
  // Those that are indexed, along a Z-curve over their bounds, and then by point::lies_before: an order of the places
  // alone, in which neighbours lie close together.
  std::vector<std::uint32_t> in_order;
};

// O(n log n).
Vertices vertices_of(std::span<const Point> points, const ForEach& for_each);

}  // namespace pointfair
