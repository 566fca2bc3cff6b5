// SPDX-License-Identifier: Apache-2.0
#include "mesh/topology.hpp"

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "mesh/blocks.hpp"

namespace pointfair {
namespace {

// An edge from a vertex to a greater or lesser one, in one of its faces.
struct Side {
  std::uint32_t there, face;
  bool is_forward;  // the face runs from here to there
};

bool precedes(const Side& a, const Side& b) { return a.there != b.there ? a.there < b.there : a.face < b.face; }

// Those of one vertex, by where they lead.
void sides_of(std::uint32_t v, const OrderedFaces& faces, std::vector<Side>& sides) {
  sides.clear();
  const std::span<const OrderedFaces::Beside> beside = faces.beside(v);
  const auto insert = [&](Side side) {
    sides.push_back(side);
    std::size_t at = sides.size() - 1;
    for (; at > 0 && precedes(side, sides[at - 1]); --at) sides[at] = sides[at - 1];
    sides[at] = side;
  };
  constexpr std::size_t kMostInserted = 32;
  if (beside.size() <= kMostInserted) {
    for (std::size_t i = 0; i < beside.size(); ++i)
      insert({beside[i].after, faces.around(v)[i], true}), insert({beside[i].before, faces.around(v)[i], false});
    return;
  }
  for (std::size_t i = 0; i < beside.size(); ++i) {
    sides.push_back({beside[i].after, faces.around(v)[i], true});
    sides.push_back({beside[i].before, faces.around(v)[i], false});
  }
  std::ranges::sort(sides, precedes);
}

struct EdgeCounts {
  std::uint64_t boundary = 0, non_manifold = 0, of_one_way = 0;  // the last with two faces that run the same way
};

constexpr std::uint32_t kNoFace = ~0u;

// Edges from the vertices of one block.
class Block {
 public:
  Block(const OrderedFaces& faces, MeshTopology& mesh) : faces_(faces), mesh_(mesh) {}

  void add(std::uint32_t v) {
    sides_of(v, faces_, sides_);
    mesh_.edges.begin[v] = neighbors.size();  // until all blocks are there
    std::uint8_t is_boundary = 0;
    for (std::size_t i = 0, end = 0; i < sides_.size(); i = end) {
      while (end < sides_.size() && sides_[end].there == sides_[i].there) ++end;
      neighbors.push_back(sides_[i].there);
      if (end - i == 1) is_boundary = 1;
      if (v > sides_[i].there) continue;  // each edge is met from both its ends
      counts.boundary += end - i == 1;
      counts.non_manifold += end - i > 2;
      if (end - i == 2) {
        join(v, sides_[i], sides_[i + 1]);
      } else {
        for (std::size_t side = i; side < end; ++side) mesh_.across[slot(v, sides_[side])] = {kNoFace, false};
      }
    }
    mesh_.edges.is_boundary[v] = is_boundary;
  }

  std::vector<std::uint32_t> neighbors;
  EdgeCounts counts;

 private:
  void join(std::uint32_t v, const Side& a, const Side& b) {
    const bool is_opposite = a.is_forward == b.is_forward;
    counts.of_one_way += is_opposite;
    mesh_.across[slot(v, a)] = {b.face, is_opposite};
    mesh_.across[slot(v, b)] = {a.face, is_opposite};
  }
  // Of the edge among those of its face: where it begins.
  std::size_t slot(std::uint32_t v, const Side& side) const {
    const auto corners = faces_.corners(side.face);
    const std::uint32_t from = side.is_forward ? v : side.there;
    return faces_.first_corner(side.face) + std::size_t(std::ranges::find(corners, from) - corners.begin());
  }

  const OrderedFaces& faces_;
  MeshTopology& mesh_;
  std::vector<Side> sides_;
};

// Moves the faces across each face's edges to its first slots.
void gather_across(const OrderedFaces& faces, const ForEach& for_each, MeshTopology& mesh) {
  mesh.across_count.resize(faces.size());
  for_mesh_items(faces.size(), for_each, [&](std::size_t f) {
    MeshTopology::Across* const its = mesh.across.data() + faces.first_corner(f);
    MeshTopology::Across* const end =
        std::remove_if(its, its + faces.corners(f).size(), [](const auto& across) { return across.face == kNoFace; });
    std::sort(its, end, [](const auto& a, const auto& b) {
      return std::tie(a.face, a.is_opposite) < std::tie(b.face, b.is_opposite);
    });
    mesh.across_count[f] = std::uint32_t(end - its);
  });
}

void count_points(const MeshEdges& edges, const ForEach& for_each, MeshReport& found) {
  const auto has_edges = [&](std::size_t v) { return edges.begin[v + 1] != edges.begin[v]; };
  found.vertices = count_items(edges.vertices(), for_each, has_edges);
  found.boundary_vertices =
      count_items(edges.vertices(), for_each, [&](std::size_t v) { return edges.is_boundary[v] != 0; });
  found.isolated_points = count_items(edges.vertex.size(), for_each, [&](std::size_t point) {
    return edges.vertex[point] == kNoVertex || !has_edges(edges.vertex[point]);
  });
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

MeshTopology topology_of(Vertices vertices, const OrderedFaces& faces, const ForEach& for_each) {
  MeshTopology mesh;
  MeshEdges& edges = mesh.edges;
  const std::size_t count = vertices.size();
  edges.vertex = std::move(vertices.of_point);
  edges.first = std::move(vertices.first);
  edges.is_boundary.resize(count);
  edges.begin.resize(count + 1);
  mesh.across.resize(faces.faces().corners.size());
  std::vector<Block> blocks(mesh_blocks(count), Block(faces, mesh));
  for_mesh_blocks(count, for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    for (auto v = std::uint32_t(first); v < last; ++v) blocks[block].add(v);
  });
  std::vector<std::size_t> begin(blocks.size() + 1);
  for (std::size_t block = 0; block < blocks.size(); ++block)
    begin[block + 1] = begin[block] + blocks[block].neighbors.size();
  edges.begin[count] = begin.back();
  edges.neighbors.resize(begin.back());
  for_mesh_blocks(count, for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    std::ranges::copy(blocks[block].neighbors, edges.neighbors.begin() + std::ptrdiff_t(begin[block]));
    for (std::size_t v = first; v < last; ++v) edges.begin[v] += begin[block];
  });
  gather_across(faces, for_each, mesh);

  MeshReport& found = mesh.found;
  found.degenerate_faces = faces.degenerate();
  found.faces = faces.size() + faces.degenerate();
  std::uint64_t of_one_way = 0;
  for (const Block& block : blocks) {
    found.boundary_edges += block.counts.boundary;
    found.non_manifold_edges += block.counts.non_manifold;
    of_one_way += block.counts.of_one_way;
  }
  edges.encloses = faces.size() > 0 && found.boundary_edges == 0 && found.non_manifold_edges == 0 && of_one_way == 0;
  count_points(edges, for_each, found);
  return mesh;
}

}  // namespace pointfair
