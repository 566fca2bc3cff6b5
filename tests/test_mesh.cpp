// SPDX-License-Identifier: Apache-2.0
// Connectivity::mesh against plain loops over rings and balls along edges, and what meshes of every kind must give.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <string>
#include <vector>

#include "meshes.h"
#include "pointfair/pipeline.hpp"
#include "reference.h"
#include "runs.h"

namespace pointfair {
namespace {

using meshes::along_mesh;
using meshes::Face;
using meshes::Mesh;
using meshes::Result;
using meshes::Sides;
using reference::Vec;
using shapes::Points, shapes::same_bits;

Mesh hill(int n, Sides sides, double noise = 0.15) {
  Mesh mesh = meshes::sheet(n, sides);
  const auto height = [](float x, float y) { return 0.2f * (x - 0.5f) * (y - 0.5f); };
  mesh.points = shapes::with_noise(shapes::lifted(mesh.points, height), noise / n, 5);
  return mesh;
}

void expect_near(const Points& found, const std::vector<Vec>& expected, double tolerance, const std::string& what) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    ASSERT_LT(reference::length(reference::to_vec(found[i]) - expected[i]), tolerance) << what << ", point " << i;
}

// The published steps over the first ring, all weights 1; the boundary stays.
std::vector<Vec> published(const Mesh& mesh, Method method, double lambda, int iterations) {
  const auto rings = meshes::rings_of(mesh);
  const std::vector<bool> boundary = meshes::boundary_of(mesh);
  std::vector<Vec> now;
  for (const Point& p : mesh.points) now.push_back(reference::to_vec(p));
  const auto mean = [&](const std::vector<Vec>& values, std::size_t i) {
    Vec sum;
    for (const std::uint32_t j : rings[i]) sum = sum + values[j];
    return 1.0 / double(rings[i].size()) * sum;
  };
  for (int iteration = 0; iteration < iterations; ++iteration) {
    std::vector<Vec> first(now.size()), next(now.size());
    for (std::size_t i = 0; i < now.size(); ++i) first[i] = now[i] + lambda * (mean(now, i) - now[i]);
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (method == Method::laplacian) next[i] = first[i];
      if (method == Method::taubin) {
        const double mu = 1 / (0.1 - 1 / lambda);
        next[i] = first[i] + mu * (mean(first, i) - first[i]);
      }
      if (method == Method::hc_laplacian) {
        std::vector<Vec> b(now.size());
        for (std::size_t j = 0; j < now.size(); ++j) b[j] = first[j] - now[j];
        next[i] = first[i] - (0.5 * b[i] + 0.5 * mean(b, i));
      }
      if (boundary[i]) next[i] = now[i];
    }
    now = next;
  }
  return now;
}

TEST(Mesh, laplace_taubin_and_hc_are_the_published_steps_over_the_ring) {
  for (const Sides sides : {Sides::triangles, Sides::quads, Sides::mixed})
    for (const Method method : {Method::laplacian, Method::taubin, Method::hc_laplacian}) {
      const Mesh mesh = hill(14, sides);
      Params params = along_mesh(method);
      params.iterations = 3;
      params.relaxation = 0.6;
      // a step that folds a face is shortened, so there must be none
      const Result result = run(mesh, params);
      expect_near(result.points, published(mesh, method, 0.6, 3), 2e-6, "method " + std::to_string(int(method)));
    }
}

TEST(Mesh, points_along_a_seam_move_as_one_and_as_in_the_welded_mesh) {
  const Mesh welded = hill(12, Sides::mixed), seams = meshes::unwelded(welded);
  for (const Method method : {Method::bilateral, Method::laplacian, Method::taubin, Method::mls, Method::mollified})
    for (const int min_neighbors : {1, 16}) {
      Params params = along_mesh(method);
      params.radius = 0.2;
      params.min_neighbors = min_neighbors;
      params.normal_sigma = params.closeness_sigma = 0.1;
      params.similarity_sigma = 0.05;
      params.relaxation = 0.5;
      const Points whole = run(welded, params).points, parts = run(seams, params).points;
      EXPECT_TRUE(same_bits(meshes::unwelded({whole, welded.faces}).points, parts))
          << int(method) << ' ' << min_neighbors;
    }
}

TEST(Mesh, of_faces_without_common_vertices_is_denoised_as_well) {
  const Mesh welded = hill(40, Sides::triangles), seams = meshes::unwelded(welded);
  for (const Method method : {Method::bilateral, Method::mls, Method::wiener}) {
    const Result whole = run(welded, along_mesh(method)), parts = run(seams, along_mesh(method));
    EXPECT_EQ(parts.report.unmoved.too_few_neighbors, 0u) << int(method);
    EXPECT_EQ(parts.report.copies, 0u) << "a vertex repeats no measurement";
    const Points expected = meshes::unwelded({whole.points, welded.faces}).points;
    EXPECT_LT(shapes::mean_distance(parts.points, expected), 0.1 * shapes::mean_distance(expected, seams.points))
        << int(method);
  }
}

// The bilateral step over balls along the mesh, by tests/reference.h over lists that are found here.
TEST(Mesh, the_bilateral_step_reads_what_edges_reach_within_the_radius) {
  Mesh lower = hill(12, Sides::triangles), upper = hill(12, Sides::quads);
  for (Point& p : upper.points) p.z += 0.05f;  // less than the radius away
  const Mesh mesh = meshes::joined(lower, upper);
  const auto rings = meshes::rings_of(mesh);
  Params params = along_mesh();
  params.radius = 0.21;
  params.min_neighbors = 1;
  params.flat_scale = 1;
  params.normal_filter = NormalFilter::off;
  params.normal_sigma = 0.15;
  params.closeness_sigma = 0.1;
  params.similarity_sigma = 0.03;
  params.offset = Offset::point;
  params.relaxation = 1;
  params.iterations = 1;
  params.outliers = Outliers::off;
  params.keep_boundary = false;
  params.noise = 0.01;
  params.crease_angle = 15;
  const Result result = run(mesh, params);
  reference::Settings settings;
  settings.radius = 0.21;
  settings.normal_sigma = 0.15;
  settings.closeness_sigma = 0.1;
  settings.similarity_sigma = 0.03;
  std::vector<reference::List> lists;
  std::vector<reference::Normal> normals;
  for (std::uint32_t i = 0; i < mesh.points.size(); ++i) {
    lists.push_back(meshes::ball_of(mesh.points, rings, i, 0.21f));
    normals.push_back(reference::normal(mesh.points, i, lists[i], settings));
  }
  const std::vector<double> area(mesh.points.size(), 1.0);
  std::size_t compared = 0;
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    if (normals[i].gap < 0.05) continue;
    ++compared;
    const double d = reference::displacement(mesh.points, i, lists[i], normals, settings, area);
    const Vec expected = reference::to_vec(mesh.points[i]) - d * normals[i].unit;
    ASSERT_LT(reference::length(reference::to_vec(result.points[i]) - expected), 1e-4) << "point " << i;
  }
  EXPECT_GT(compared, mesh.points.size() / 2);
}

// But for rounding: the order of sums follows the curve through all points.
TEST(Mesh, a_near_sheet_changes_nothing) {
  const Mesh alone = hill(20, Sides::triangles);
  Mesh upper = alone;
  for (Point& p : upper.points) p.z += 0.03f;
  Params params = along_mesh();
  params.noise = 0.0075;
  params.radius = 0.12;
  params.min_neighbors = 1;
  params.similarity_sigma = 0.02;
  params.crease_angle = 15;
  params.relaxation = 1;
  params.outliers = Outliers::off;
  const Points expected = run(alone, params).points, both = run(meshes::joined(alone, upper), params).points;
  const auto most_off = [&](const Points& points) {
    double most = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) most = std::max(most, shapes::distance(points[i], expected[i]));
    return most;
  };
  EXPECT_LT(most_off(both), 2e-6);
  Params by_points = params;
  by_points.connectivity = Connectivity::points;
  EXPECT_GT(most_off(run(meshes::joined(alone, upper), by_points).points), 0.005);
}

TEST(Mesh, the_order_of_points_and_faces_their_first_corners_and_threads_change_no_bit) {
  const Mesh mesh = hill(25, Sides::mixed, 0.4);
  const auto order = shapes::shuffle_order(mesh.points.size(), 3);
  const Mesh shuffled = meshes::shuffled(mesh, order);
  for (const Method method : {Method::bilateral, Method::taubin}) {
    Params params = along_mesh(method);
    params.tangential.reset();
    const Result one = run(mesh, params, 1), other = run(shuffled, params, 3);
    EXPECT_TRUE(same_bits(shapes::permuted(one.points, order), other.points)) << int(method);
    EXPECT_EQ(one.report.mesh.folded_before, other.report.mesh.folded_before);
    EXPECT_EQ(one.report.mesh.folded_after, other.report.mesh.folded_after);
  }
}

TEST(Mesh, the_boundary_stays_unless_it_may_move) {
  const Mesh mesh = hill(12, Sides::triangles);
  const std::vector<bool> boundary = meshes::boundary_of(mesh);
  for (const bool keeps : {true, false}) {
    Params params = along_mesh();
    params.keep_boundary = keeps;
    params.tangential.reset();
    const Points after = run(mesh, params).points;
    std::size_t moved = 0;
    for (std::size_t i = 0; i < after.size(); ++i)
      moved += boundary[i] && std::memcmp(&after[i], &mesh.points[i], sizeof(Point)) != 0;
    EXPECT_EQ(moved > 0, !keeps);
  }
}

TEST(Mesh, what_is_wrong_with_a_mesh_is_counted) {
  Mesh mesh = hill(6, Sides::triangles);
  const auto points = std::uint32_t(mesh.points.size());
  mesh.points.push_back({0.5f, 0.5f, 0.9f});   // of no face
  mesh.points.push_back({0.5f, 0.4f, 0.7f});   // of a third face at an edge within
  mesh.faces.push_back({0, 1});                // no face
  mesh.faces.push_back({8, 8, 9});             // the same
  mesh.faces.push_back({8, 9, 10, 9});         // meets a place twice
  mesh.faces.push_back({16, 24, points + 1});  // 16 and 24 are joined by a diagonal
  const Result result = run(mesh, along_mesh());
  const MeshReport& found = result.report.mesh;
  EXPECT_EQ(found.faces, 6u * 6 * 2 + 4);
  EXPECT_EQ(found.degenerate_faces, 3u);
  EXPECT_EQ(found.isolated_points, 1u);
  EXPECT_EQ(found.vertices, points + 1);
  EXPECT_EQ(found.non_manifold_edges, 1u);
  EXPECT_EQ(found.boundary_edges, 4u * 6 + 2);
  EXPECT_EQ(found.boundary_vertices, 4u * 6 + 3);
  EXPECT_EQ(std::memcmp(&result.points[points], &mesh.points[points], sizeof(Point)), 0);
  EXPECT_GE(result.report.unmoved.too_few_neighbors, 1u);
}

TEST(Mesh, a_face_may_run_round_the_other_way) {
  const Mesh mesh = hill(12, Sides::triangles, 0.05);
  Mesh flipped = mesh;
  for (std::size_t f = 0; f < flipped.faces.size(); f += 3)
    std::reverse(flipped.faces[f].begin(), flipped.faces[f].end());
  const Result one = run(mesh, along_mesh()), other = run(flipped, along_mesh());
  EXPECT_TRUE(same_bits(one.points, other.points));
  EXPECT_EQ(other.report.mesh.folded_before, one.report.mesh.folded_before);
}

TEST(Mesh, what_cannot_be_is_said_in_one_line) {
  const auto refused = [](const Mesh& of, const Params& params, const std::string& part) {
    expect_error(ErrorKind::usage, part, [&] { run(of, params); });
  };
  Mesh mesh = hill(4, Sides::triangles);
  Params with_k = along_mesh();
  with_k.k = 8;
  refused(mesh, with_k, "--rings");
  refused(mesh, {.rings = 2}, "--connectivity mesh");
  Mesh without_faces = mesh;
  without_faces.faces.clear();
  refused(without_faces, along_mesh(), "needs faces");
  mesh.faces[3][1] = 25;
  refused(mesh, along_mesh(), "face 3 has the corner 25");
}

}  // namespace
}  // namespace pointfair
