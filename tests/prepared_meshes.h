// SPDX-License-Identifier: Apache-2.0
// Noisy meshes with their vertices, faces and edges, for tests of what is done with these.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <set>
#include <vector>

#include "mesh/topology.hpp"
#include "meshes.h"

namespace pointfair::meshes {

using Vec = Eigen::Vector3d;

inline Vec at(const Points& points, std::uint32_t i) { return {points[i].x, points[i].y, points[i].z}; }

// Newell's, twice the area long.
inline Vec normal_of(const Points& points, const Face& face) {
  Vec sum = Vec::Zero();
  for (std::size_t i = 0; i < face.size(); ++i)
    sum += at(points, face[i]).cross(at(points, face[(i + 1) % face.size()]));
  return sum;
}

// Each coordinate has noise, in edges of the grid.
inline Mesh noisy(int n, Sides sides, double noise, std::uint64_t seed = 9) {
  Mesh mesh = meshes::sheet(n, sides);
  mesh.points = shapes::with_noise(mesh.points, noise / n, seed);
  return mesh;
}

inline const ForEach one_after_the_other = [](std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
};

// A mesh whose points all differ, and its points in the order of the vertices and back.
struct Prepared {
  explicit Prepared(const Mesh& mesh)
      : vertices(vertices_of(mesh.points, one_after_the_other)),
        faces(vertices, meshes::polygons_of(mesh.faces), one_after_the_other),
        topology(topology_of(vertices, faces, one_after_the_other)) {}

  Points places(const Points& points) const {
    const auto its = vertices.places(points, one_after_the_other);
    return {its.begin(), its.end()};
  }
  Points points(const Points& places) const {
    Points result(places.size());
    for (std::size_t v = 0; v < places.size(); ++v) result[vertices.first[v]] = places[v];
    return result;
  }
  Face corners(std::size_t face) const {
    Face its;
    for (const std::uint32_t v : faces.corners(face)) its.push_back(vertices.first[v]);
    return its;
  }

  Vertices vertices;
  OrderedFaces faces;
  MeshTopology topology;
};

}  // namespace pointfair::meshes
