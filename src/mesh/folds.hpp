// SPDX-License-Identifier: Apache-2.0
// Folded faces, and steps that are shortened so that they fold none.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "point/vec.h"
#include "pointfair/cloud.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

// The faces of a mesh in an order that depends on the places of their corners alone, so that sums over them have the
// same bits for any order of faces and points.
class OrderedFaces {
 public:
  // `points` give the order, `vertex` as MeshEdges. Degenerate faces are left out, as by topology_of().
  OrderedFaces(std::span<const Point> points, std::span<const std::uint32_t> vertex, const Polygons& faces);

  std::size_t size() const { return faces_.size(); }
  // Vertices, by the first point at each place.
  std::span<const std::uint32_t> corners(std::size_t face) const { return faces_.of(face); }
  const MeshFaces& faces() const { return faces_; }

  // Whether each face is folded: its normal is more than 90 degrees off its filtered normal. That is the mean of its
  // normal and those of the faces across its edges, weighted by area, twice over; normals of faces that run round the
  // other way count with the opposite sign. A face without area is not folded.
  std::vector<std::uint8_t> folded(std::span<const Point> points) const;

 private:
  struct Across {
    std::uint32_t face;
    bool is_opposite;  // runs round the other way
  };

  void find_neighbors();
  std::vector<point::Vec3<double>> area_normals(std::span<const Point> points) const;
  std::vector<point::Vec3<double>> filtered(const std::vector<point::Vec3<double>>& normals) const;

  MeshFaces faces_;
  std::vector<std::size_t> across_begin_;
  std::vector<Across> across_;  // of each face, those that share an edge
};

// Shortens steps from `before` to `after` so that no face is folded which `folded_before` does not name. In each round
// the steps of all corners of such faces are halved at once, and after kMostHalvings they are not made; a step that was
// halved stays so. Rounds end where none is folded or no step is left. The order of the faces does not matter. Returns
// the folded faces that remain.
std::vector<std::uint8_t> unfold(const OrderedFaces& faces, std::span<const std::uint32_t> vertex,
                                 std::span<const std::uint8_t> folded_before, std::span<const Point> before,
                                 std::span<Point> after);

}  // namespace pointfair
