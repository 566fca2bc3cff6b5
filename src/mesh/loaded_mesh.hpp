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
  LoadedMesh(std::vector<Point> its_points, const Polygons& polygons, const ForEach& for_each)
      : points(std::move(its_points)),
        vertices(vertices_of(points, for_each)),
        faces(points, vertices, polygons, for_each),
        topology(topology_of(vertices, faces, for_each)),
        folded(Folds(faces, points, for_each).folded()) {}

  std::vector<Point> points;
  Vertices vertices;
  OrderedFaces faces;
  MeshTopology topology;
  std::vector<std::uint8_t> folded;  // of those faces
};

}  // namespace pointfair
