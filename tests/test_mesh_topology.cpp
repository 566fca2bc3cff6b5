// SPDX-License-Identifier: Apache-2.0
// Vertices, ordered faces and edges of a mesh with everything wrong, against maps over places.
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "mesh/loaded_mesh.hpp"
#include "meshes.h"

namespace pointfair {
namespace {

using meshes::Face;
using meshes::Mesh;
using shapes::Points;
using Place = std::array<float, 3>;
using Edge = std::pair<Place, Place>;
using PlacedFace = std::vector<Place>;

Place place(const Point& p) { return {p.x + 0.0f, p.y + 0.0f, p.z + 0.0f}; }

// More vertices and faces than one block of a loop has, welded in places, with points of no face, of a place that is
// written as 0 and as -0, and not finite; faces of three at an edge, turned round, degenerate and repeated.
Mesh torn_mesh() {
  shapes::Random random(5);
  const Mesh welded = meshes::sheet(90, meshes::Sides::mixed);
  Mesh mesh = meshes::joined(welded, meshes::unwelded(meshes::sheet(30, meshes::Sides::triangles, 0.25)));
  const auto add = [&](Point p) {
    mesh.points.push_back(p);
    return std::uint32_t(mesh.points.size() - 1);
  };
  const auto any = [&] { return std::uint32_t(random.below(mesh.points.size())); };
  for (int i = 0; i < 200; ++i) mesh.faces.push_back({any(), any(), any()});
  for (int i = 0; i < 50; ++i) mesh.faces.push_back({any(), any(), any(), any(), any()});
  for (int i = 0; i < 20; ++i) mesh.faces.push_back(mesh.faces[random.below(mesh.faces.size())]);
  mesh.faces.push_back({7, 7, 8});
  mesh.faces.push_back({7, 8, 9, 8});
  const std::uint32_t minus = add({-0.0f, -0.0f, -0.0f}),
                      nowhere = add({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  add({3, 3, 3});
  mesh.faces.push_back({minus, 500, 900});
  mesh.faces.push_back({nowhere, 600, 700});
  for (Face& face : mesh.faces)
    if (random.below(4) == 0) std::reverse(face.begin(), face.end());

  std::vector<std::uint32_t> to(mesh.points.size());
  for (std::uint32_t i = 0; i < to.size(); ++i) to[i] = i;
  for (std::size_t i = to.size(); i > 1; --i) std::swap(to[i - 1], to[random.below(i)]);
  Mesh shuffled{Points(to.size()), {}};
  for (std::size_t i = 0; i < to.size(); ++i) shuffled.points[to[i]] = mesh.points[i];
  for (Face face : mesh.faces) {
    for (std::uint32_t& corner : face) corner = to[corner];
    shuffled.faces.insert(shuffled.faces.begin() + std::ptrdiff_t(random.below(shuffled.faces.size() + 1)), face);
  }
  return shuffled;
}

// From its least place on; empty if it is degenerate.
PlacedFace placed(const Mesh& mesh, const Face& face) {
  PlacedFace result;
  for (const std::uint32_t corner : face) {
    if (!std::isfinite(mesh.points[corner].x)) return {};
    if (const Place at = place(mesh.points[corner]); result.empty() || result.back() != at) result.push_back(at);
  }
  while (result.size() > 1 && result.back() == result.front()) result.pop_back();
  if (result.size() < 3 || std::set<Place>(result.begin(), result.end()).size() < result.size()) return {};
  return result;
}

PlacedFace from_least(PlacedFace face) {
  std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
  return face;
}

const ForEach forwards = [](std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
};
// As other threads may.
const ForEach backwards = [](std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = count; i > 0; --i) body(i - 1);
};

TEST(MeshTopology, is_what_maps_over_places_say) {
  const Mesh mesh = torn_mesh();
  const LoadedMesh loaded(mesh.points, meshes::polygons_of(mesh.faces), forwards);
  const MeshEdges& edges = loaded.topology.edges;
  const auto at = [&](std::uint32_t v) { return place(loaded.places[v]); };

  std::multiset<PlacedFace> faces;
  std::map<Edge, std::vector<std::pair<PlacedFace, bool>>> at_edge;  // faces, and whether they run along it
  for (const Face& face : mesh.faces) {
    const PlacedFace its = placed(mesh, face);
    if (its.empty()) continue;
    faces.insert(from_least(its));
    for (std::size_t i = 0; i < its.size(); ++i) {
      const Place from = its[i], to = its[(i + 1) % its.size()];
      at_edge[std::minmax(from, to)].push_back({from_least(its), from < to});
    }
  }
  EXPECT_EQ(loaded.topology.found.degenerate_faces, mesh.faces.size() - faces.size());
  EXPECT_GE(mesh.faces.size() - faces.size(), 3u);

  const auto face_of = [&](std::size_t f) {
    PlacedFace its;
    for (const std::uint32_t v : loaded.faces.corners(f)) its.push_back(at(v));
    return from_least(its);
  };
  std::multiset<PlacedFace> found_faces;
  for (std::size_t f = 0; f < loaded.faces.size(); ++f) found_faces.insert(face_of(f));
  EXPECT_EQ(found_faces, faces);

  std::set<Edge> found_edges, boundary;
  for (std::uint32_t v = 0; v < edges.vertices(); ++v)
    for (const std::uint32_t there : edges.neighbors_of(v)) EXPECT_TRUE(found_edges.insert({at(v), at(there)}).second);
  std::set<Place> on_boundary;
  std::uint64_t non_manifold = 0;
  for (const auto& [edge, its] : at_edge) {
    EXPECT_EQ(found_edges.erase(edge) + found_edges.erase({edge.second, edge.first}), 2u);
    non_manifold += its.size() > 2;
    if (its.size() == 1) boundary.insert(edge), on_boundary.insert(edge.first), on_boundary.insert(edge.second);
  }
  EXPECT_TRUE(found_edges.empty());
  EXPECT_EQ(loaded.topology.found.boundary_edges, boundary.size());
  EXPECT_EQ(loaded.topology.found.non_manifold_edges, non_manifold);
  EXPECT_GT(non_manifold, 0u);
  for (std::uint32_t v = 0; v < edges.vertices(); ++v)
    ASSERT_EQ(edges.is_boundary[v] != 0, on_boundary.count(at(v)) > 0) << "vertex " << v;

  std::map<PlacedFace, std::multiset<std::pair<PlacedFace, bool>>> across, found_across;
  for (const auto& [edge, its] : at_edge) {
    if (its.size() != 2) continue;
    const bool is_opposite = its[0].second == its[1].second;
    across[its[0].first].insert({its[1].first, is_opposite});
    across[its[1].first].insert({its[0].first, is_opposite});
  }
  std::uint64_t opposite = 0;
  for (std::size_t f = 0; f < loaded.faces.size(); ++f)
    for (const MeshTopology::Across& its : loaded.topology.across_of(loaded.faces, f)) {
      found_across[face_of(f)].insert({face_of(its.face), its.is_opposite});
      opposite += its.is_opposite;
    }
  EXPECT_EQ(found_across, across);
  EXPECT_GT(opposite, 0u);
}

TEST(MeshTopology, what_runs_when_changes_nothing) {
  const Mesh mesh = torn_mesh();
  const Polygons faces = meshes::polygons_of(mesh.faces);
  const LoadedMesh one(mesh.points, faces, forwards), other(mesh.points, faces, backwards);
  EXPECT_EQ(one.topology.edges.vertex, other.topology.edges.vertex);
  EXPECT_EQ(one.topology.edges.first, other.topology.edges.first);
  EXPECT_EQ(one.topology.edges.neighbors, other.topology.edges.neighbors);
  EXPECT_EQ(one.faces.faces().corners, other.faces.faces().corners);
  EXPECT_EQ(one.faces.faces().around_faces, other.faces.faces().around_faces);
  EXPECT_EQ(one.topology.across_count, other.topology.across_count);
  EXPECT_EQ(one.folded, other.folded);
  for (std::uint32_t i = 0; i < mesh.points.size(); ++i) {
    const std::uint32_t v = one.topology.edges.vertex[i];
    if (v == kNoVertex) continue;
    EXPECT_EQ(place(mesh.points[i]), place(mesh.points[one.topology.edges.first[v]]));
    EXPECT_LE(one.topology.edges.first[v], i);
  }
}

}  // namespace
}  // namespace pointfair
