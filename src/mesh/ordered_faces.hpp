// SPDX-License-Identifier: Apache-2.0
// The faces of a mesh in an order of their own, and which of them meet.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/vertices.hpp"
#include "point/vec.h"
#include "pointfair/cloud.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

inline point::Vec3<double> place_of(std::span<const Point> points, std::uint32_t at) {
  return {points[at].x, points[at].y, points[at].z};
}

// Of a face, twice the area long.
inline point::Vec3<double> face_normal(std::span<const std::uint32_t> corners, std::span<const Point> points) {
  return area_normal(corners, [&](std::uint32_t at) { return place_of(points, at); });
}

// The faces of a mesh in an order that depends on the places of their corners alone, so that sums over them have the
// same bits for any order of faces and points.
class OrderedFaces {
 public:
  // Degenerate faces (mesh/face_corners.hpp) are left out. O(n log n) in points and corners.
  OrderedFaces(std::span<const Point> points, const Vertices& vertices, const Polygons& faces, const ForEach& for_each);

  std::size_t size() const { return faces_.size(); }
  std::uint64_t degenerate() const { return degenerate_; }
  // Vertices.
  std::span<const std::uint32_t> corners(std::size_t face) const { return faces_.of(face); }
  const MeshFaces& faces() const { return faces_; }
  // In the order of their places, as Vertices::in_order: loops over them meet faces and points that lie close together
  // in memory, however a file orders them.
  std::span<const std::uint32_t> vertices() const { return vertices_; }
  // The faces at a vertex, ascending.
  std::span<const std::uint32_t> around(std::uint32_t vertex) const { return faces_.around(vertex); }

  struct Across {
    std::uint32_t face;
    bool is_opposite;  // runs round the other way
  };
  // The faces across the edges of a face that have no third one, ascending.
  std::span<const Across> across(std::size_t face) const {
    const std::size_t begin = face == 0 ? 0 : faces_.ends[face - 1];
    return {across_.data() + begin, across_count_[face]};
  }

 private:
  void collect(std::span<const Point> points, const Vertices& vertices, const Polygons& faces, const ForEach& for_each);
  void collect_around(std::size_t points);
  bool find_across(std::size_t face);

  MeshFaces faces_;
  std::vector<std::uint32_t> vertices_;
  std::uint64_t degenerate_ = 0;
  std::vector<Across> across_;  // of each face from its first corner on
  std::vector<std::uint32_t> across_count_;
};

}  // namespace pointfair
