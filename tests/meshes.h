// SPDX-License-Identifier: Apache-2.0
// Meshes for tests, and what faces say of their points in the plainest code: nothing is shared with src/mesh.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair::meshes {

using shapes::Points;
using Face = std::vector<std::uint32_t>;

struct Mesh {
  Points points;
  std::vector<Face> faces;
};

inline Polygons polygons_of(const std::vector<Face>& faces) {
  Polygons result;
  for (const Face& face : faces) {
    result.corners.insert(result.corners.end(), face.begin(), face.end());
    result.ends.push_back(result.corners.size());
  }
  return result;
}

// A square of n x n quads at height `z`, each one quad, two triangles, or, where `mixed`, now this and now that.
enum class Sides { quads, triangles, mixed };
inline Mesh sheet(int n, Sides sides, double z = 0) {
  Mesh mesh;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) mesh.points.push_back(shapes::make_point(double(i) / n, double(j) / n, z));
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const auto a = std::uint32_t(i * (n + 1) + j), b = a + std::uint32_t(n + 1), c = b + 1, d = a + 1;
      if (sides == Sides::quads || (sides == Sides::mixed && (i + j) % 2 == 0)) {
        mesh.faces.push_back({a, b, c, d});
      } else {
        mesh.faces.push_back({a, b, c});
        mesh.faces.push_back({a, c, d});
      }
    }
  return mesh;
}

inline Mesh joined(const Mesh& a, const Mesh& b) {
  Mesh mesh = a;
  mesh.points.insert(mesh.points.end(), b.points.begin(), b.points.end());
  for (Face face : b.faces) {
    for (std::uint32_t& corner : face) corner += std::uint32_t(a.points.size());
    mesh.faces.push_back(face);
  }
  return mesh;
}

// Each face with corners of its own, as in STL files.
inline Mesh unwelded(const Mesh& mesh) {
  Mesh result;
  for (const Face& face : mesh.faces) {
    Face own;
    for (const std::uint32_t corner : face) {
      own.push_back(std::uint32_t(result.points.size()));
      result.points.push_back(mesh.points[corner]);
    }
    result.faces.push_back(own);
  }
  return result;
}

// The points in another order, and the faces from the last to the first, each from its second corner on.
inline Mesh shuffled(const Mesh& mesh, const std::vector<std::uint32_t>& order) {
  std::vector<std::uint32_t> now(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) now[order[i]] = i;
  Mesh result{shapes::permuted(mesh.points, order), {mesh.faces.rbegin(), mesh.faces.rend()}};
  for (Face& face : result.faces) {
    for (std::uint32_t& corner : face) corner = now[corner];
    std::rotate(face.begin(), face.begin() + 1, face.end());
  }
  return result;
}

using Place = std::tuple<float, float, float>;
inline Place place_of(Point p) { return {p.x, p.y, p.z}; }

// Of each point, one point for every other place that an edge joins with its own.
inline std::vector<std::set<std::uint32_t>> rings_of(const Mesh& mesh) {
  std::map<Place, std::uint32_t> first;
  for (std::uint32_t i = 0; i < mesh.points.size(); ++i) first.emplace(place_of(mesh.points[i]), i);
  const auto vertex = [&](std::uint32_t i) { return first.at(place_of(mesh.points[i])); };
  std::vector<std::set<std::uint32_t>> rings(mesh.points.size());
  for (const Face& face : mesh.faces)
    for (std::size_t i = 0; i < face.size(); ++i) {
      const std::uint32_t a = vertex(face[i]), b = vertex(face[(i + 1) % face.size()]);
      if (a != b) rings[a].insert(b), rings[b].insert(a);
    }
  for (std::uint32_t i = 0; i < mesh.points.size(); ++i) rings[i] = rings[vertex(i)];
  return rings;
}

// Points on edges that one face has.
inline std::vector<bool> boundary_of(const Mesh& mesh) {
  std::map<std::pair<Place, Place>, int> faces;
  for (const Face& face : mesh.faces)
    for (std::size_t i = 0; i < face.size(); ++i) {
      const Place a = place_of(mesh.points[face[i]]), b = place_of(mesh.points[face[(i + 1) % face.size()]]);
      if (a != b) ++faces[std::minmax(a, b)];
    }
  std::set<Place> places;
  for (const auto& [edge, count] : faces)
    if (count == 1) places.insert(edge.first), places.insert(edge.second);
  std::vector<bool> result;
  for (const Point& p : mesh.points) result.push_back(places.count(place_of(p)) > 0);
  return result;
}

// Those that paths of edges reach from `start` whose vertices all lie within `radius` of it.
inline std::vector<std::uint32_t> ball_of(const Points& points, const std::vector<std::set<std::uint32_t>>& rings,
                                          std::uint32_t start, float radius) {
  const auto squared = [&](std::uint32_t i) {
    const float x = points[i].x - points[start].x, y = points[i].y - points[start].y, z = points[i].z - points[start].z;
    return x * x + y * y + z * z;
  };
  std::set<std::uint32_t> seen = {start};
  std::deque<std::uint32_t> waiting = {start};
  while (!waiting.empty()) {
    for (const std::uint32_t next : rings[waiting.front()])
      if (squared(next) <= radius * radius && seen.insert(next).second) waiting.push_back(next);
    waiting.pop_front();
  }
  seen.erase(start);
  return {seen.begin(), seen.end()};
}

struct Result {
  Points points;
  Report report;
};

// Along the mesh, and nothing afterwards.
inline Params along_mesh(Method method = Method::bilateral) {
  return {.connectivity = Connectivity::mesh, .method = method, .tangential = 0};
}

// A mesh without faces is a cloud.
inline Result run_on(const Device& device, const Mesh& mesh, const Params& params) {
  Pipeline pipeline = loaded(mesh.points, device);
  if (!mesh.faces.empty()) pipeline.set_faces(polygons_of(mesh.faces));
  Result result{Points(mesh.points.size()), {}};
  pipeline.run(params, result.points);
  result.report = pipeline.report();
  return result;
}

// On the CPU, and where there is a card on that, with the same bits.
inline Result run(const Mesh& mesh, const Params& params, unsigned threads = 0) {
  const Result result = run_on(Device(Device::cpu, 0, threads), mesh, params);
  if (!test::why_no_card().empty() || reads_faces(params)) return result;
  const Result of_card = run_on(Device::cuda, mesh, params);
  EXPECT_TRUE(shapes::same_bits(of_card.points, result.points)) << "on a card";
  EXPECT_EQ(of_card.report.unmoved, result.report.unmoved) << "on a card";
  EXPECT_EQ(of_card.report.solver.iterations, result.report.solver.iterations) << "on a card";
  EXPECT_EQ(of_card.report.solver.residual, result.report.solver.residual) << "on a card";
  EXPECT_EQ(of_card.report.mesh.folded_before, result.report.mesh.folded_before) << "on a card";
  EXPECT_EQ(of_card.report.mesh.folded_after, result.report.mesh.folded_after) << "on a card";
  return result;
}

}  // namespace pointfair::meshes
