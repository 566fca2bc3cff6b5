// SPDX-License-Identifier: Apache-2.0
// What faces say of the points: which are one vertex, which are joined by edges, and where the mesh ends.
#pragma once

#include "mesh/ordered_faces.hpp"
#include "pointfair/cloud.hpp"
#include "pointfair/report.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

struct MeshTopology {
  MeshEdges edges;
  MeshReport found;
};

// Throws Error(usage) for a corner that is no point.
void check_faces(const Polygons& faces, std::size_t points);

// Of faces that check_faces() accepted, in their order. Points at one place are one vertex; points that are not finite
// make no edges. It does not depend on the orientation of the faces.
MeshTopology topology_of(const Vertices& vertices, const OrderedFaces& faces, const ForEach& for_each);

}  // namespace pointfair
