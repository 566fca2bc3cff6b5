// SPDX-License-Identifier: Apache-2.0
#include "mesh/topology.hpp"

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "mesh/face_corners.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {
namespace {

// Of each point, the first at its place.
std::vector<std::uint32_t> vertices_of(std::span<const Point> points) {
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::erase_if(order, [&](std::uint32_t i) { return !is_indexed(points[i]); });
  const auto lies_before = [&](std::uint32_t a, std::uint32_t b) {
    return point::lies_before(to_vec3(points[a]), to_vec3(points[b]));
  };
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return lies_before(a, b) || (!lies_before(b, a) && a < b); });
  std::vector<std::uint32_t> vertex(points.size());
  std::iota(vertex.begin(), vertex.end(), 0u);
  for (std::size_t i = 1; i < order.size(); ++i)
    if (!lies_before(order[i - 1], order[i])) vertex[order[i]] = vertex[order[i - 1]];
  return vertex;
}

// Calls visit(vertex, vertex) for the edges of each face; returns how many faces are degenerate.
template <class Visit>
std::uint64_t for_each_side(FaceCorners& faces, const Visit& visit) {
  return faces.for_each([&](std::span<const std::uint32_t> corners) {
    for (std::size_t i = 0; i < corners.size(); ++i) visit(corners[i], corners[i + 1 < corners.size() ? i + 1 : 0]);
  });
}

// Each vertex's neighbours once for every face at their edge, ascending.
// Returns how many faces are degenerate.
std::uint64_t collect_neighbors(FaceCorners& faces, MeshEdges& edges) {
  const std::size_t points = edges.vertex.size();
  edges.begin.assign(points + 1, 0);
  const std::uint64_t degenerate =
      for_each_side(faces, [&](std::uint32_t a, std::uint32_t b) { ++edges.begin[a + 1], ++edges.begin[b + 1]; });
  std::partial_sum(edges.begin.begin(), edges.begin.end(), edges.begin.begin());
  edges.neighbors.resize(edges.begin.back());
  std::vector<std::uint64_t> next(edges.begin.begin(), edges.begin.end() - 1);
  for_each_side(faces, [&](std::uint32_t a, std::uint32_t b) {
    edges.neighbors[next[a]++] = b;
    edges.neighbors[next[b]++] = a;
  });
  for (std::size_t v = 0; v < points; ++v)
    std::sort(edges.neighbors.begin() + std::ptrdiff_t(edges.begin[v]),
              edges.neighbors.begin() + std::ptrdiff_t(edges.begin[v + 1]));
  return degenerate;
}

// Counts the faces at each edge, and leaves each neighbour once.
void count_edges(MeshTopology& mesh) {
  MeshEdges& edges = mesh.edges;
  std::uint64_t kept = 0, begin = 0;
  for (std::uint32_t v = 0; v < edges.vertex.size(); ++v) {
    const std::uint64_t end = edges.begin[v + 1];
    for (std::uint64_t i = begin; i < end;) {
      const std::uint32_t there = edges.neighbors[i];
      std::uint64_t faces = 0;
      for (; i < end && edges.neighbors[i] == there; ++i) ++faces;
      edges.neighbors[kept++] = there;
      if (faces == 1) edges.is_boundary[v] = 1;
      if (v > there) continue;  // each edge is met from both its ends
      mesh.found.boundary_edges += faces == 1;
      mesh.found.non_manifold_edges += faces > 2;
    }
    begin = end;
    edges.begin[v + 1] = kept;
  }
  edges.neighbors.resize(kept);
  edges.neighbors.shrink_to_fit();
}

}  // namespace

void check_faces(const Polygons& faces, std::size_t points) {
  std::uint64_t begin = 0;
  for (std::size_t f = 0; f < faces.ends.size(); ++f) {
    if (faces.ends[f] < begin || faces.ends[f] > faces.corners.size())
      throw Error(ErrorKind::usage, "face " + std::to_string(f) + " ends at corner " + std::to_string(faces.ends[f]) +
                                        ", which does not lie between " + std::to_string(begin) + " and " +
                                        std::to_string(faces.corners.size()));
    for (; begin < faces.ends[f]; ++begin) {
      if (faces.corners[begin] < points) continue;
      throw Error(ErrorKind::usage, "face " + std::to_string(f) + " has the corner " +
                                        std::to_string(faces.corners[begin]) + ", and the cloud has " +
                                        std::to_string(points) + " points; corners count from 0");
    }
  }
}

MeshTopology topology_of(std::span<const Point> points, const Polygons& faces) {
  MeshTopology mesh;
  MeshEdges& edges = mesh.edges;
  edges.vertex = vertices_of(points);
  edges.is_boundary.assign(points.size(), 0);
  FaceCorners corners(points, faces, edges.vertex);
  mesh.found.degenerate_faces = collect_neighbors(corners, edges);
  count_edges(mesh);
  mesh.found.faces = faces.size();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::uint32_t v = edges.vertex[i];
    const bool has_edges = edges.begin[v + 1] > edges.begin[v];
    edges.is_boundary[i] = edges.is_boundary[v];
    if (!has_edges) {
      ++mesh.found.isolated_points;
    } else if (v == i) {
      ++mesh.found.vertices;
      mesh.found.boundary_vertices += edges.is_boundary[v];
    }
  }
  return mesh;
}

}  // namespace pointfair
