// SPDX-License-Identifier: Apache-2.0
// Method::implicit against Eigen's direct solver on systems that plain loops put together: nothing is shared with
// src/cpu.
#include <gtest/gtest.h>

#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "meshes.h"
#include "pointfair/pipeline.hpp"
#include "reference_neighbors.h"

namespace pointfair {
namespace {

using meshes::Mesh;
using meshes::Result;
using meshes::Sides;
using reference::Vec;
using shapes::Points, shapes::same_bits;

Params implicit(ImplicitWeights weights, double lambda, Connectivity connectivity) {
  Params params{
      .connectivity = connectivity, .method = Method::implicit, .implicit_weights = weights, .implicit_lambda = lambda};
  if (connectivity == Connectivity::mesh) params.tangential = 0;
  return params;
}

// A sheet of waves with noise, and a closed one: a cube's surface blown up to a ball.
Mesh hill(int n, Sides sides, double noise = 0.1) {
  Mesh mesh = meshes::sheet(n, sides);
  const auto height = [](float x, float y) { return 0.2f * std::sin(5 * x) * y; };
  mesh.points = shapes::with_noise(shapes::lifted(mesh.points, height), noise / n, 5);
  return mesh;
}

Mesh ball(int n, double radius, double noise) {
  Mesh mesh;
  for (int side = 0; side < 6; ++side) {
    Mesh part = meshes::sheet(n, Sides::triangles);
    for (Point& p : part.points) {
      const double u = std::tan((2 * p.x - 1) * 0.785398), v = std::tan((2 * p.y - 1) * 0.785398);
      double c[3];
      c[side % 3] = side < 3 ? 1 : -1;
      c[(side + 1) % 3] = u;
      c[(side + 2) % 3] = side < 3 ? v : -v;
      const double length = std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
      // rounded, so that corners of neighbouring sides are at one place
      const auto rounded = [&](double x) { return std::round(radius * x / length * 65536) / 65536; };
      p = shapes::make_point(rounded(c[0]), rounded(c[1]), rounded(c[2]));
    }
    mesh = meshes::joined(mesh, part);
  }
  for (Point& p : mesh.points) {  // by place, so that they stay at one
    const double turn = 12.9898 * p.x + 78.233 * p.y + 37.719 * p.z;
    const double by = 1 + noise / radius * std::sin(43758.5453 * std::sin(turn));
    p = shapes::make_point(by * p.x, by * p.y, by * p.z);
  }
  return mesh;
}

double volume_of(const Mesh& mesh, const Points& points) {
  double sum = 0;
  for (const meshes::Face& face : mesh.faces)
    for (std::size_t i = 2; i < face.size(); ++i) {
      const Vec a = reference::to_vec(points[face[0]]), b = reference::to_vec(points[face[i - 1]]),
                c = reference::to_vec(points[face[i]]);
      sum += (a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) + a.z * (b.x * c.y - b.y * c.x)) / 6;
    }
  return sum;
}

// S of the docs' Eq. 28 as dense rows of weights, and M.
struct System {
  std::vector<std::map<std::uint32_t, double>> weights;
  std::vector<double> mass;
  double unit = 1;
  explicit System(std::size_t points) : weights(points), mass(points) {}
};

double length_between(const Points& points, std::size_t i, std::size_t j) {
  return shapes::distance(points[i], points[j]);
}

double mean_length(const System& system, const Points& points) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    for (const auto& [j, weight] : system.weights[i]) sum += length_between(points, i, j), ++count;
  return sum / count;
}

void weigh(System& system, const Points& points, ImplicitWeights by, double sigma) {
  const double mean = mean_length(system, points);
  for (std::size_t i = 0; i < points.size(); ++i)
    for (auto& [j, weight] : system.weights[i]) {
      const double length = length_between(points, i, j);
      if (by == ImplicitWeights::scale) {
        system.mass[i] += weight * length / 2;
        weight /= length;
      } else {
        if (by == ImplicitWeights::curvature) weight *= std::exp(-length * length / (2 * sigma * sigma));
        system.mass[i] += weight;
      }
    }
  if (by == ImplicitWeights::scale) system.unit = mean * mean / 2;
}

System of_rings(const Mesh& mesh, ImplicitWeights by) {
  System system(mesh.points.size());
  const auto rings = meshes::rings_of(mesh);
  for (std::size_t i = 0; i < rings.size(); ++i)
    for (const std::uint32_t j : rings[i]) system.weights[i][j] = 1;
  weigh(system, mesh.points, by, 0);
  return system;
}

// Of triangles.
System of_cotangents(const Mesh& mesh) {
  System system(mesh.points.size());
  for (const meshes::Face& face : mesh.faces)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t i = face[c], a = face[(c + 1) % 3], b = face[(c + 2) % 3];
      const Vec to_a = reference::to_vec(mesh.points[a]) - reference::to_vec(mesh.points[i]);
      const Vec to_b = reference::to_vec(mesh.points[b]) - reference::to_vec(mesh.points[i]);
      const double angle = std::acos(reference::dot(to_a, to_b) / (reference::length(to_a) * reference::length(to_b)));
      system.weights[a][b] += 1 / std::tan(angle) / 4;
      system.weights[b][a] += 1 / std::tan(angle) / 4;
      system.mass[i] += std::sin(angle) * reference::length(to_a) * reference::length(to_b) / 2;
    }
  const double mean = mean_length(system, mesh.points);
  system.unit = 1.5 * mean * mean;
  return system;
}

System of_lists(const Points& points, std::size_t k, ImplicitWeights by, double sigma) {
  System system(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    for (const std::uint32_t j : reference::nearest(points, i, k)) {
      system.weights[i][j] += 0.5;
      system.weights[j][std::uint32_t(i)] += 0.5;
    }
  weigh(system, points, by, sigma);
  return system;
}

std::vector<Vec> solved(const System& system, const Points& points, double lambda, const std::vector<bool>& stays) {
  const auto n = Eigen::Index(points.size());
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixXd right(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vec p = reference::to_vec(points[std::size_t(i)]);
    const double mass = stays[std::size_t(i)] ? 1 : system.mass[std::size_t(i)];
    right.row(i) << mass * p.x, mass * p.y, mass * p.z;
    entries.emplace_back(i, i, mass);
    if (stays[std::size_t(i)]) continue;
    for (const auto& [j, weight] : system.weights[std::size_t(i)]) {
      entries.emplace_back(i, i, lambda * system.unit * weight);
      entries.emplace_back(i, Eigen::Index(j), -lambda * system.unit * weight);
    }
  }
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::SparseLU<Eigen::SparseMatrix<double>> solver(matrix);
  const Eigen::MatrixXd found = solver.solve(right);
  std::vector<Vec> result;
  for (Eigen::Index i = 0; i < n; ++i) result.push_back({found(i, 0), found(i, 1), found(i, 2)});
  return result;
}

// To the residual that the solver states, and the rounding of a float.
void expect_solved(const Result& found, const std::vector<Vec>& expected, const Points& before,
                   const std::string& what) {
  double whole = 0, off = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Vec off_there = reference::to_vec(found.points[i]) - expected[i];
    const Vec way = expected[i] - reference::to_vec(before[i]);
    off += reference::dot(off_there, off_there);
    whole += reference::dot(way, way);
  }
  EXPECT_GT(whole, 0) << what;
  EXPECT_LT(std::sqrt(off / double(expected.size())), 3e-6 * std::sqrt(whole / double(expected.size())) + 1e-7) << what;
  EXPECT_LE(found.report.solver.residual, 1e-6) << what;
  EXPECT_GT(found.report.solver.iterations, 2u) << what;
}

TEST(Implicit, along_a_mesh_it_solves_the_system_of_each_weight) {
  const Mesh mesh = hill(14, Sides::triangles);
  for (const bool keeps : {true, false})
    for (const double lambda : {0.5, 20.0})
      for (const auto by : {ImplicitWeights::uniform, ImplicitWeights::scale, ImplicitWeights::curvature}) {
        Params params = implicit(by, lambda, Connectivity::mesh);
        params.keep_boundary = keeps;
        std::vector<bool> stays = keeps ? meshes::boundary_of(mesh) : std::vector<bool>(mesh.points.size());
        for (std::size_t i = 0; i < stays.size(); ++i)
          if (meshes::rings_of(mesh)[i].size() < 3) stays[i] = true;
        const System system = by == ImplicitWeights::curvature ? of_cotangents(mesh) : of_rings(mesh, by);
        expect_solved(run(mesh, params), solved(system, mesh.points, lambda, stays), mesh.points,
                      std::to_string(int(by)) + " " + std::to_string(lambda) + (keeps ? " kept" : ""));
      }
}

TEST(Implicit, on_a_cloud_an_edge_weighs_alike_from_both_ends) {
  const Mesh cloud{shapes::with_noise(shapes::waves(900), 0.01), {}};
  for (const auto by : {ImplicitWeights::uniform, ImplicitWeights::scale, ImplicitWeights::curvature}) {
    Params params = implicit(by, 8, Connectivity::points);
    params.k = 7;
    const Result found = run(cloud, params);
    const System system = of_lists(cloud.points, 7, by, found.report.params.closeness_sigma.value);
    expect_solved(found, solved(system, cloud.points, 8, std::vector<bool>(900)), cloud.points,
                  std::to_string(int(by)));
  }
}

TEST(Implicit, threads_and_the_order_of_points_and_faces_change_no_bit) {
  const Mesh mesh = hill(70, Sides::mixed);  // more than one block of a sum
  const auto order = shapes::shuffle_order(mesh.points.size(), 9);
  const Mesh shuffled = meshes::shuffled(mesh, order);
  for (const auto connectivity : {Connectivity::mesh, Connectivity::points})
    for (const auto by : {ImplicitWeights::uniform, ImplicitWeights::scale, ImplicitWeights::curvature}) {
      Params params = implicit(by, 5, connectivity);
      params.noise = 0.001;
      params.closeness_sigma = 0.02;
      params.iterations = 2;
      const Result one = run(mesh, params, 1);
      EXPECT_TRUE(same_bits(one.points, run(mesh, params, 3).points));
      EXPECT_TRUE(same_bits(shapes::permuted(one.points, order), run(shuffled, params, 2).points));
    }
}

TEST(Implicit, each_closed_part_keeps_its_volume_and_points_at_one_place_stay_together) {
  Mesh far = ball(8, 0.4, 0.004);
  for (Point& p : far.points) p.x += 3;
  const Mesh near = ball(12, 1, 0.01), both = meshes::joined(near, far);
  for (const auto by : {ImplicitWeights::uniform, ImplicitWeights::curvature}) {
    const Result found = run(both, implicit(by, 10, Connectivity::mesh));
    ASSERT_EQ(found.report.mesh.boundary_edges, 0u);
    const Points first(found.points.begin(), found.points.begin() + std::ptrdiff_t(near.points.size()));
    const Points second(found.points.begin() + std::ptrdiff_t(near.points.size()), found.points.end());
    EXPECT_NEAR(volume_of(near, first) / volume_of(near, near.points), 1, 1e-5);
    EXPECT_NEAR(volume_of(far, second) / volume_of(far, far.points), 1, 1e-5);
    std::map<meshes::Place, Point> at;
    for (std::size_t i = 0; i < both.points.size(); ++i) {
      const Point to = at.try_emplace(meshes::place_of(both.points[i]), found.points[i]).first->second;
      EXPECT_EQ(std::memcmp(&to, &found.points[i], sizeof to), 0);
    }
  }
}

TEST(Implicit, an_open_mesh_has_no_volume_to_keep_and_its_border_is_counted_as_kept) {
  const Mesh mesh = hill(12, Sides::quads);
  const Result found = run(mesh, implicit(ImplicitWeights::curvature, 5, Connectivity::mesh));
  const std::vector<bool> boundary = meshes::boundary_of(mesh);
  const auto border = std::uint64_t(std::count(boundary.begin(), boundary.end(), true));
  std::uint64_t stayed = 0;
  for (std::size_t i = 0; i < mesh.points.size(); ++i)
    stayed += std::memcmp(&found.points[i], &mesh.points[i], sizeof(Point)) == 0;
  EXPECT_EQ(stayed, border);
  EXPECT_EQ(found.report.unmoved.boundary + found.report.unmoved.too_few_neighbors, border);
  EXPECT_EQ(found.report.unmoved.total(), border);
}

TEST(Implicit, thin_triangles_points_at_one_place_and_points_alone_leave_it_finite) {
  Mesh mesh = hill(10, Sides::triangles);
  mesh.points[40] = mesh.points[41];
  mesh.points[40].x += 1e-7f;
  mesh.points.push_back({0.5f, 0.5f, 5});
  mesh.points.push_back({NAN, 0, 0});
  for (const auto connectivity : {Connectivity::mesh, Connectivity::points})
    for (const auto by : {ImplicitWeights::uniform, ImplicitWeights::scale, ImplicitWeights::curvature}) {
      const Result found = run(mesh, implicit(by, 30, connectivity));
      for (std::size_t i = 0; i + 1 < mesh.points.size(); ++i)
        ASSERT_TRUE(std::isfinite(found.points[i].x + found.points[i].y + found.points[i].z)) << i;
      EXPECT_LE(found.report.solver.residual, 1e-6);
    }
  const Mesh same{shapes::identical(40), {}};
  EXPECT_TRUE(same_bits(run(same, implicit(ImplicitWeights::scale, 3, Connectivity::points)).points, same.points));
}

TEST(Implicit, rings_beyond_the_first_are_refused) {
  Params params = implicit(ImplicitWeights::uniform, 1, Connectivity::mesh);
  params.rings = 2;
  EXPECT_THROW(check_params(params), Error);
}

}  // namespace
}  // namespace pointfair
