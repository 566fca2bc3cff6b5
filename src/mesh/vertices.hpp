// SPDX-License-Identifier: Apache-2.0
// Which points are one vertex.
#pragma once

#include <cstdint>
#include <span>

#include "platform/large_vector.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

// Vertices are numbered along a Z-curve over their bounds, and then by point::lies_before: an order of the places
// alone, in which neighbours lie close together, however a file orders its points.
struct Vertices {
  platform::LargeVector<std::uint32_t> of_point;  // kNoVertex of a point that is not indexed
  platform::LargeVector<std::uint32_t> first;     // of each vertex, the first point at its place

  std::size_t size() const { return first.size(); }
  // Of each vertex.
  platform::LargeVector<Point> places(std::span<const Point> points, const ForEach& for_each) const;
};

// O(n log n) in the points that lie in one of 64^3 parts of the bounds.
Vertices vertices_of(std::span<const Point> points, const ForEach& for_each);

}  // namespace pointfair
