// SPDX-License-Identifier: Apache-2.0
#include "mesh/topology.hpp"

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "mesh/blocks.hpp"

namespace pointfair {
namespace {

// The neighbours of one vertex, ascending, once for every face at their edge.
void sides_of(std::uint32_t v, const OrderedFaces& faces, std::vector<std::uint32_t>& sides) {
  sides.clear();
  for (const std::uint32_t f : faces.around(v)) {
    const auto corners = faces.corners(f);
    const auto own = std::size_t(std::find(corners.begin(), corners.end(), v) - corners.begin());
    sides.push_back(corners[own + 1 < corners.size() ? own + 1 : 0]);
    sides.push_back(corners[own > 0 ? own - 1 : corners.size() - 1]);
  }
  std::sort(sides.begin(), sides.end());
}

// Calls visit(neighbour, faces at the edge) for each neighbour.
template <class Visit>
void for_each_edge(const std::vector<std::uint32_t>& sides, const Visit& visit) {
  for (std::size_t i = 0, end = 0; i < sides.size(); i = end) {
    while (end < sides.size() && sides[end] == sides[i]) ++end;
    visit(sides[i], end - i);
  }
}

struct EdgeCounts {
  std::uint64_t boundary = 0, non_manifold = 0;
};

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

MeshTopology topology_of(const Vertices& vertices, const OrderedFaces& faces, const ForEach& for_each) {
  MeshTopology mesh;
  MeshEdges& edges = mesh.edges;
  const std::size_t points = vertices.of_point.size();
  edges.vertex = vertices.of_point;
  edges.is_boundary.assign(points, 0);
  edges.begin.assign(points + 1, 0);
  std::vector<EdgeCounts> counts(mesh_blocks(points));
  std::vector<std::vector<std::uint32_t>> of_block(counts.size());
  for_mesh_blocks(points, for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    std::vector<std::uint32_t> sides;
    for (auto v = std::uint32_t(first); v < last; ++v) {
      sides_of(v, faces, sides);
      for_each_edge(sides, [&](std::uint32_t there, std::size_t its_faces) {
        ++edges.begin[v + 1];
        of_block[block].push_back(there);
        if (its_faces == 1) edges.is_boundary[v] = 1;
        if (v > there) return;  // each edge is met from both its ends
        counts[block].boundary += its_faces == 1;
        counts[block].non_manifold += its_faces > 2;
      });
    }
  });
  std::partial_sum(edges.begin.begin(), edges.begin.end(), edges.begin.begin());
  edges.neighbors.reserve(edges.begin.back());
  for (const std::vector<std::uint32_t>& its : of_block)
    edges.neighbors.insert(edges.neighbors.end(), its.begin(), its.end());

  MeshReport& found = mesh.found;
  found.degenerate_faces = faces.degenerate();
  found.faces = faces.size() + faces.degenerate();
  for (const EdgeCounts& its : counts) {
    found.boundary_edges += its.boundary;
    found.non_manifold_edges += its.non_manifold;
  }
  for (std::size_t i = 0; i < points; ++i) {
    const std::uint32_t v = edges.vertex[i];
    const bool has_edges = edges.begin[v + 1] > edges.begin[v];
    if (!has_edges) {
      ++found.isolated_points;
    } else if (v == i) {
      ++found.vertices;
      found.boundary_vertices += edges.is_boundary[v];
    } else {
      edges.is_boundary[i] = edges.is_boundary[v];
    }
  }
  return mesh;
}

}  // namespace pointfair
