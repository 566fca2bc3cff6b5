// SPDX-License-Identifier: Apache-2.0
// Folded faces, steps along the surface and shortened steps against the plainest code.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "mesh/evening.hpp"
#include "mesh/folds.hpp"
#include "pointfair/pipeline.hpp"
#include "prepared_meshes.h"

namespace pointfair {
namespace {

using meshes::at;
using meshes::Face;
using meshes::Mesh;
using meshes::noisy;
using meshes::normal_of;
using meshes::one_after_the_other;
using meshes::Prepared;
using meshes::Sides;
using meshes::Vec;
using shapes::Points;

// By the rule of docs/methods.md, from faces that all run round the same way.
std::set<Face> folded_of(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::size_t>> faces_of;
  std::vector<Vec> normals;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Face& face = mesh.faces[f];
    for (std::size_t i = 0; i < face.size(); ++i)
      faces_of[std::minmax(face[i], face[(i + 1) % face.size()])].push_back(f);
    normals.push_back(normal_of(mesh.points, face));
  }
  std::vector<Vec> wide = normals;
  for (int round = 0; round < 2; ++round) {
    std::vector<Vec> sums = wide;
    for (const auto& [edge, its] : faces_of)
      if (its.size() == 2) sums[its[0]] += wide[its[1]], sums[its[1]] += wide[its[0]];
    wide = sums;
  }
  std::set<Face> folded;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    if (normals[f].dot(wide[f]) < 0) folded.insert(mesh.faces[f]);
  return folded;
}

std::vector<std::uint8_t> as_bytes(const Folds& folds) { return {folds.folded().begin(), folds.folded().end()}; }

std::vector<std::uint8_t> folded_at(const Prepared& mesh, const Points& points) {
  return as_bytes(Folds(mesh.faces, mesh.topology, mesh.places(points), one_after_the_other));
}

// Of a face of `faces`, as the mesh has it.
Face as_given(const Face& corners, const Mesh& mesh) {
  const std::set<std::uint32_t> wanted(corners.begin(), corners.end());
  for (const Face& face : mesh.faces)
    if (std::set<std::uint32_t>(face.begin(), face.end()) == wanted) return face;
  return {};
}

TEST(Folds, are_faces_turned_from_those_around_them) {
  for (const Sides sides : {Sides::triangles, Sides::quads, Sides::mixed}) {
    const Mesh mesh = noisy(24, sides, 0.45);
    const Prepared prepared(mesh);
    const std::vector<std::uint8_t> folded = folded_at(prepared, mesh.points);
    const std::set<Face> expected = folded_of(mesh);
    EXPECT_GT(expected.size(), 10u);
    std::set<Face> found;
    for (std::size_t f = 0; f < prepared.faces.size(); ++f)
      if (folded[f] != 0) found.insert(as_given(prepared.corners(f), mesh));
    EXPECT_EQ(found, expected);
  }
}

// One vertex of a fan, by matrices.
TEST(Evening, steps_along_the_surface_and_little_across) {
  const Mesh mesh = noisy(8, Sides::triangles, 0.3);
  const auto rings = meshes::rings_of(mesh);
  const double sigma = 0.3 / 8, share = 0.8;
  const Prepared prepared(mesh);
  std::vector<std::uint8_t> stays(mesh.points.size(), 1);
  const std::uint32_t v = 4 * 9 + 4;
  stays[prepared.vertices.of_point[v]] = 0;
  Points places = prepared.places(mesh.points);
  even_out(prepared.faces, stays, share, std::vector(places.size(), sigma), places, one_after_the_other);
  const Points moved = prepared.points(places);
  Points expected = mesh.points;
  double e = 0;
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix3d t = Eigen::Matrix3d::Zero();
    double area = 0, squares = 0;
    for (const Face& face : mesh.faces) {
      if (std::find(face.begin(), face.end(), v) == face.end()) continue;
      const Vec normal = normal_of(expected, face);
      t += normal * normal.transpose() / normal.norm();
      area += normal.norm();
    }
    Vec middle = Vec::Zero();
    for (const std::uint32_t j : rings[v]) {
      middle += at(expected, j) / double(rings[v].size());
      squares += (at(expected, j) - at(expected, v)).squaredNorm() / double(rings[v].size());
    }
    if (round == 0) e = std::min(sigma * sigma / squares, 0.5);
    const Eigen::Matrix3d matrix = t / area + e * Eigen::Matrix3d::Identity();
    const Vec there = at(expected, v) + share * e * matrix.inverse() * (middle - at(expected, v));
    ASSERT_LT((there - at(mesh.points, v)).norm(), 3 * sigma);
    expected[v] = shapes::make_point(there.x(), there.y(), there.z());
  }
  for (std::uint32_t i = 0; i < moved.size(); ++i)
    EXPECT_LT((at(moved, i) - at(expected, i)).norm(), 1e-6) << "point " << i;
  EXPECT_GT((at(moved, v) - at(mesh.points, v)).norm(), 1e-3);
}

TEST(Evening, no_vertex_goes_farther_than_three_sigma) {
  const Mesh mesh = noisy(10, Sides::triangles, 0.5);
  const std::vector<std::uint8_t> stays(mesh.points.size(), 0);
  const Prepared prepared(mesh);
  Points places = prepared.places(mesh.points);
  even_out(prepared.faces, stays, 1, std::vector(places.size(), 0.01), places, one_after_the_other);
  const Points moved = prepared.points(places);
  double farthest = 0;
  for (std::uint32_t i = 0; i < moved.size(); ++i)
    farthest = std::max(farthest, (at(moved, i) - at(mesh.points, i)).norm());
  EXPECT_LT(farthest, 0.03 * (1 + 1e-5));
  EXPECT_GT(farthest, 0.0299);
}

// By the counted paths of two rings.
TEST(Evening, steps_of_the_rings_tell_the_noise) {
  const Mesh before = noisy(9, Sides::triangles, 0.3), after = noisy(9, Sides::triangles, 0.3, 77);
  const Prepared prepared(before);
  const auto count = std::uint32_t(before.points.size());
  Eigen::MatrixXd paths = Eigen::MatrixXd::Identity(count, count);
  for (const Face& face : before.faces)
    for (std::size_t i = 0; i < face.size(); ++i) {
      const std::uint32_t v = face[i], w = face[(i + 1) % face.size()];
      paths(v, w) += 1, paths(w, v) += 1;
    }
  std::vector<std::uint8_t> stays(count, 0);
  Eigen::VectorXd squares(count), moves(count);
  for (std::uint32_t v = 0; v < count; ++v) {
    stays[prepared.vertices.of_point[v]] = v % 7 == 0;
    moves(v) = v % 7 != 0;
    squares(v) = moves(v) * (at(after.points, v) - at(before.points, v)).squaredNorm();
  }
  const double most = 0.1;
  const auto noise = noise_by_steps(prepared.faces, stays, most, prepared.places(before.points),
                                    prepared.places(after.points), one_after_the_other);
  const Eigen::VectorXd sums = paths * (paths * squares), counts = paths * (paths * moves);
  std::uint32_t bounded = 0;
  for (std::uint32_t v = 0; v < count; ++v) {
    const double expected = 1.2 * std::sqrt(sums(v) / counts(v));
    bounded += expected > most;
    EXPECT_NEAR(noise[prepared.vertices.of_point[v]], std::min(most, expected), 1e-6) << "vertex " << v;
  }
  EXPECT_GT(bounded, 5u);
  EXPECT_LT(bounded, count - 5);
  for (const double its : noise_by_steps(prepared.faces, stays, most, prepared.places(before.points),
                                         prepared.places(before.points), one_after_the_other))
    EXPECT_EQ(its, 0);
}

TEST(Unfold, halves_steps_until_no_face_is_folded_that_was_not) {
  const Mesh before = noisy(20, Sides::triangles, 0.1), after = noisy(20, Sides::triangles, 0.5, 77);
  const Prepared prepared(before);
  const std::vector<std::uint8_t> at_first = folded_at(prepared, before.points);
  Points places = prepared.places(after.points);
  Folds folds(prepared.faces, prepared.topology, places, one_after_the_other);
  unfold(folds, at_first, prepared.places(before.points), places);
  const Points points = prepared.points(places);
  const std::vector<std::uint8_t> left = as_bytes(folds);
  EXPECT_EQ(left, folded_at(prepared, points));
  std::size_t folded = 0, whole = 0;
  for (const std::uint8_t one : folded_at(prepared, after.points)) folded += one;
  EXPECT_GT(folded, 20u);
  for (std::size_t f = 0; f < left.size(); ++f) EXPECT_LE(left[f], at_first[f]);
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Vec step = at(after.points, i) - at(before.points, i), made = at(points, i) - at(before.points, i);
    const double share = made.dot(step) / step.squaredNorm();
    ASSERT_LT((made - share * step).norm(), 1e-6);
    if (share < 1e-6) continue;
    const double halvings = -std::log2(share);
    ASSERT_NEAR(halvings, std::round(halvings), 1e-2) << "point " << i;
    ASSERT_LT(halvings, 6.5);
    whole += halvings < 0.5;
  }
  EXPECT_GT(whole, points.size() / 4);
}

// As a whole.
TEST(Mesh, faces_unfold_and_clean_meshes_stay) {
  const Params params{.connectivity = Connectivity::mesh};
  const MeshReport found = run(noisy(40, Sides::triangles, 0.45), params).report.mesh;
  EXPECT_GT(found.folded_before, 100u);
  EXPECT_LT(found.folded_after, found.folded_before / 10);
  const Mesh clean = meshes::sheet(40, Sides::triangles);
  const meshes::Result stays = run(clean, params);
  EXPECT_EQ(stays.report.mesh.folded_after, 0u);
  for (std::uint32_t i = 0; i < clean.points.size(); ++i)
    ASSERT_LT((at(stays.points, i) - at(clean.points, i)).norm(), 1e-4 / 40) << "point " << i;
}

TEST(Mesh, where_the_method_moves_nothing_nothing_evens_out) {
  Mesh mesh = noisy(40, Sides::triangles, 0.2);
  for (Point& point : mesh.points) point.z = 0;
  const Points points = run(mesh, {.noise = 0.3 / 40, .connectivity = Connectivity::mesh}).points;
  for (std::uint32_t i = 0; i < points.size(); ++i)
    ASSERT_LT((at(points, i) - at(mesh.points, i)).norm(), 1e-3 / 40) << "point " << i;
}

}  // namespace
}  // namespace pointfair
