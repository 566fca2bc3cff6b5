// SPDX-License-Identifier: Apache-2.0
// What faces say of the points: which vertices edges join, which faces meet at one, and where the mesh ends.
#pragma once

#include <cstdint>
#include <span>

#include "mesh/ordered_faces.hpp"
#include "pointfair/cloud.hpp"
#include "pointfair/report.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

struct MeshTopology {
  MeshEdges edges;
  MeshReport found;

  struct Across {
    std::uint32_t face;
    bool is_opposite;  // runs round the other way
  };
  platform::LargeVector<Across> across;  // of each face from its first corner on
  platform::LargeVector<std::uint32_t> across_count;

  // The faces across the edges of a face that have no third one, ascending.
  std::span<const Across> across_of(const OrderedFaces& faces, std::size_t face) const {
    return {across.data() + faces.first_corner(face), across_count[face]};
  }
};

// Throws Error(usage) for a corner that is no point.
void check_faces(const Polygons& faces, std::size_t points);

// Of faces that check_faces() accepted, in their order. Points at one place are one vertex; points that are not finite
// make no edges. The edges do not depend on the orientation of the faces. O(n log n) in the edges of each vertex.
MeshTopology topology_of(Vertices vertices, const OrderedFaces& faces, const ForEach& for_each);

}  // namespace pointfair
