// SPDX-License-Identifier: Apache-2.0
// The edges and faces of a mesh over the uploaded points. Points at one place are one vertex. Vertices have numbers of
// their own, from 0, in an order that depends on the places alone.
#pragma once

#include <cstdint>
#include <span>

#include "platform/large_vector.hpp"
#include "point/vec.h"

namespace pointfair {

inline constexpr std::uint32_t kNoVertex = ~0u;

struct MeshEdges {
  platform::LargeVector<std::uint32_t> vertex;      // of each point; kNoVertex of one that is not indexed
  platform::LargeVector<std::uint32_t> first;       // of each vertex, the first point at its place, in upload order
  platform::LargeVector<std::uint64_t> begin;       // of each vertex's neighbours; one more at the end
  platform::LargeVector<std::uint32_t> neighbors;   // vertices, ascending
  platform::LargeVector<std::uint8_t> is_boundary;  // of each vertex
  bool encloses = false;                            // every edge has two faces, of one orientation: there is a volume

  std::size_t vertices() const { return first.size(); }
  bool is_on_boundary(std::uint32_t point) const {
    return vertex[point] != kNoVertex && is_boundary[vertex[point]] != 0;
  }

  std::span<const std::uint32_t> neighbors_of(std::uint32_t its_vertex) const {
    return {neighbors.data() + begin[its_vertex], neighbors.data() + begin[its_vertex + 1]};
  }
};

// Faces one after the other, in an order that depends on the places of their corners alone.
struct MeshFaces {
  platform::LargeVector<std::size_t> ends;          // of each face, in `corners`
  platform::LargeVector<std::uint32_t> corners;     // vertices
  platform::LargeVector<std::size_t> around_begin;  // of each vertex, in `around_faces`; one more at the end
  platform::LargeVector<std::uint32_t> around_faces;

  std::size_t size() const { return ends.size(); }
  std::span<const std::uint32_t> of(std::size_t face) const {
    const std::size_t begin = face == 0 ? 0 : ends[face - 1];
    return {corners.data() + begin, ends[face] - begin};
  }
  // The faces at a vertex, ascending.
  std::span<const std::uint32_t> around(std::uint32_t vertex) const {
    return {around_faces.data() + around_begin[vertex], around_faces.data() + around_begin[vertex + 1]};
  }
};

// Of a face, twice the area long; `place_of` tells where a corner is.
template <class PlaceOf>
point::Vec3<double> area_normal(std::span<const std::uint32_t> corners, const PlaceOf& place_of) {
  const point::Vec3<double> first = place_of(corners[0]);
  point::Vec3<double> sum{};
  for (std::size_t c = 2; c < corners.size(); ++c)
    sum = sum + cross(place_of(corners[c - 1]) - first, place_of(corners[c]) - first);
  return sum;
}

}  // namespace pointfair
