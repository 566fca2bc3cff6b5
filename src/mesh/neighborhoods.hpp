// SPDX-License-Identifier: Apache-2.0
// What the neighbourhoods of a typical vertex of a mesh show: the values that Fleishman, Drori and Cohen-Or (2003) take
// from a neighbourhood which the user marks.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/loaded_mesh.hpp"

namespace pointfair {

// Medians over up to kMeasuredVertices vertices within the mesh, evenly drawn from the order of their places, so that
// they depend neither on the order of points and faces nor on threads. Lengths are in file units.
class MeshNeighborhoods {
 public:
  // `mesh` must outlive this.
  explicit MeshNeighborhoods(const LoadedMesh& mesh);

  // Of the greatest distance to a vertex up to two edges away; 0 if no vertex has edges.
  double two_ring_radius() const;
  // Of the standard deviation of the heights over the tangent plane, whose normal is the mean of the faces' normals
  // weighted by area, among what edges reach within the radius.
  double height_deviation(double radius) const;

  static constexpr std::size_t kMeasuredVertices = 2000;

 private:
  const LoadedMesh& mesh_;
  std::vector<std::uint32_t> measured_;
};

}  // namespace pointfair
