// SPDX-License-Identifier: Apache-2.0
// A mesh as it was loaded, with all that runs along it ask for.
#pragma once

#include <cstdint>
#include <span>
#include <utility>

#include "mesh/folds.hpp"
#include "mesh/topology.hpp"

namespace pointfair {

struct LoadedMesh {
  LoadedMesh(std::span<const Point> points, const Polygons& polygons, const ForEach& for_each)
      : LoadedMesh(points, vertices_of(points, for_each), polygons, for_each) {}

  platform::LargeVector<Point> places;  // of the vertices
  OrderedFaces faces;
  MeshTopology topology;
  platform::LargeVector<std::uint8_t> folded;  // of those faces

 private:
  LoadedMesh(std::span<const Point> points, Vertices vertices, const Polygons& polygons, const ForEach& for_each)
      : places(vertices.places(points, for_each)),
        faces(vertices, polygons, for_each),
        topology(topology_of(std::move(vertices), faces, for_each)),
        folded(Folds(faces, topology, places, for_each).folded()) {}
};

}  // namespace pointfair
