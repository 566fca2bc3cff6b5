// SPDX-License-Identifier: Apache-2.0
// A mesh as it was loaded, with all that runs along it ask for.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "mesh/folds.hpp"
#include "mesh/topology.hpp"

namespace pointfair {

struct LoadedMesh {
  LoadedMesh(std::vector<Point> its_points, const Polygons& polygons)
      : points(std::move(its_points)),
        topology(topology_of(points, polygons)),
        faces(points, topology.edges.vertex, polygons),
        folded(faces.folded(points)) {}

  std::vector<Point> points;
  MeshTopology topology;
  OrderedFaces faces;
  std::vector<std::uint8_t> folded;  // of those faces
};

}  // namespace pointfair
