// SPDX-License-Identifier: Apache-2.0
// What faces say of the points: which are one vertex, which are joined by edges, and where the mesh ends.
#pragma once

#include <memory>
#include <span>

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

// Of faces that check_faces() accepts. Points at one place are one vertex; points that are not finite make no edges. It
// does not depend on the order of the faces, nor on their orientation. O(n log n) in points and corners.
MeshTopology topology_of(std::span<const Point> points, const Polygons& faces);

}  // namespace pointfair
