// SPDX-License-Identifier: Apache-2.0
// The faces of a mesh in an order of their own, and those around each vertex.
#pragma once

#include <cstdint>
#include <span>

#include "mesh/vertices.hpp"
#include "point/vec.h"
#include "pointfair/cloud.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

// `places`: of the vertices.
inline point::Vec3<double> place_of(std::span<const Point> places, std::uint32_t vertex) {
  return {places[vertex].x, places[vertex].y, places[vertex].z};
}

// Of a face, twice the area long.
inline point::Vec3<double> face_normal(std::span<const std::uint32_t> corners, std::span<const Point> places) {
  return area_normal(corners, [&](std::uint32_t vertex) { return place_of(places, vertex); });
}

// The faces of a mesh in an order that depends on the places of their corners alone, so that sums over them have the
// same bits for any order of faces and points.
class OrderedFaces {
 public:
  // Degenerate faces are left out: a corner at the place of the one before it is no corner, and a face is degenerate if
  // fewer than three are left, if it meets a place twice, or if a corner is not finite. Linear in points and corners.
  OrderedFaces(const Vertices& vertices, const Polygons& faces, const ForEach& for_each);

  std::size_t size() const { return faces_.size(); }
  std::size_t vertices() const { return faces_.around_begin.size() - 1; }
  std::uint64_t degenerate() const { return degenerate_; }
  // Vertices.
  std::span<const std::uint32_t> corners(std::size_t face) const { return faces_.of(face); }
  std::size_t first_corner(std::size_t face) const { return face == 0 ? 0 : faces_.ends[face - 1]; }
  const MeshFaces& faces() const { return faces_; }
  // The faces at a vertex, ascending.
  std::span<const std::uint32_t> around(std::uint32_t vertex) const { return faces_.around(vertex); }

  struct Beside {
    std::uint32_t after, before;
  };
  // Of each face at a vertex, in the order of around(), its corners after and before the vertex.
  std::span<const Beside> beside(std::uint32_t vertex) const {
    return {beside_.data() + faces_.around_begin[vertex], beside_.data() + faces_.around_begin[vertex + 1]};
  }

 private:
  void collect(const Vertices& vertices, const Polygons& faces, const ForEach& for_each);
  void collect_around(std::size_t vertices, const ForEach& for_each);

  MeshFaces faces_;
  std::uint64_t degenerate_ = 0;
  platform::LargeVector<Beside> beside_;  // as faces_.around_faces
};

}  // namespace pointfair
