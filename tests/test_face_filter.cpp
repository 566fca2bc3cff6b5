// SPDX-License-Identifier: Apache-2.0
// Vertices that follow filtered normals, and shape that is given back, against the plainest code.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "mesh/face_filter.hpp"
#include "prepared_meshes.h"

namespace pointfair {
namespace {

using meshes::at;
using meshes::Face;
using meshes::Mesh;
using meshes::noisy;
using meshes::one_after_the_other;
using meshes::Prepared;
using meshes::Sides;
using meshes::Vec;
using shapes::Points;

Vec normal_of(const std::vector<Vec>& places, const Face& face) {
  Vec sum = Vec::Zero();
  for (std::size_t i = 0; i < face.size(); ++i) sum += places[face[i]].cross(places[face[(i + 1) % face.size()]]);
  return sum;
}

std::vector<Vec> vectors_of(const Points& points) {
  std::vector<Vec> result;
  for (std::uint32_t i = 0; i < points.size(); ++i) result.push_back(at(points, i));
  return result;
}

// By the formulas of docs/methods.md, from faces that all run round the same way; vertices on the border stay.
std::vector<Vec> followed(const Mesh& mesh, const std::vector<bool>& stays, double noise) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::size_t>> faces_of;
  const std::vector<Vec> start = vectors_of(mesh.points);
  std::vector<Vec> normals;
  std::vector<double> areas, limits;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Face& face = mesh.faces[f];
    double squares = 0;
    for (std::size_t i = 0; i < face.size(); ++i) {
      const std::uint32_t v = face[i], w = face[(i + 1) % face.size()];
      faces_of[std::minmax(v, w)].push_back(f);
      squares += (start[v] - start[w]).squaredNorm() / double(face.size());
    }
    const Vec normal = normal_of(start, face);
    normals.push_back(normal.normalized());
    areas.push_back(normal.norm());
    limits.push_back(2 * noise / std::sqrt(squares));
  }
  const auto add = [&](std::vector<Vec>& sums, std::size_t f, std::size_t there) {
    const double x = (normals[f] - normals[there]).norm() / limits[f];
    if (x < 1) sums[f] += areas[there] * std::pow(1 - x * x, 2) * normals[there];
  };
  for (int round = 0; round < 8; ++round) {
    std::vector<Vec> sums(normals.size(), Vec::Zero());
    for (std::size_t f = 0; f < normals.size(); ++f) add(sums, f, f);
    for (const auto& [edge, its] : faces_of)
      if (its.size() == 2) add(sums, its[0], its[1]), add(sums, its[1], its[0]);
    for (std::size_t f = 0; f < normals.size(); ++f) normals[f] = sums[f].normalized();
  }
  std::vector<Vec> places = start;
  for (int move = 0; move < 6; ++move) {
    std::vector<Vec> steps(places.size(), Vec::Zero());
    std::vector<int> counts(places.size());
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      Vec middle = Vec::Zero();
      for (const std::uint32_t v : mesh.faces[f]) middle += places[v] / double(mesh.faces[f].size());
      for (const std::uint32_t v : mesh.faces[f])
        steps[v] += normals[f] * normals[f].dot(middle - places[v]), ++counts[v];
    }
    for (std::size_t v = 0; v < places.size(); ++v)
      if (!stays[v]) places[v] += 1.5 / counts[v] * steps[v];
  }
  return places;
}

TEST(FaceFilter, vertices_follow_the_filtered_normals_of_their_faces) {
  const double noise = 0.1 / 16;
  for (const Sides sides : {Sides::triangles, Sides::quads, Sides::mixed}) {
    const Mesh mesh = noisy(16, sides, 0.2);
    const std::vector<bool> stays = meshes::boundary_of(mesh);
    const std::vector<Vec> expected = followed(mesh, stays, noise);
    for (const bool turns : {false, true}) {
      Mesh given = mesh;
      for (std::size_t f = 0; turns && f < given.faces.size(); f += 3)
        std::reverse(given.faces[f].begin(), given.faces[f].end());
      const Prepared prepared(given);
      std::vector<std::uint8_t> its_stays(stays.size());
      for (std::size_t v = 0; v < stays.size(); ++v) its_stays[prepared.vertices.of_point[v]] = stays[v];
      Points places = prepared.places(given.points);
      follow_filtered_normals(prepared.faces, prepared.topology, its_stays, std::vector(places.size(), noise), places,
                              one_after_the_other);
      const Points moved = prepared.points(places);
      double farthest = 0;
      for (std::uint32_t i = 0; i < moved.size(); ++i) {
        EXPECT_LT((at(moved, i) - expected[i]).norm(), 1e-5 / 16) << "point " << i;
        farthest = std::max(farthest, (at(moved, i) - at(mesh.points, i)).norm());
      }
      EXPECT_GT(farthest, 0.5 * noise);
    }
  }
}

TEST(FaceFilter, without_noise_no_vertex_moves) {
  const Mesh mesh = noisy(12, Sides::mixed, 0.2);
  const Prepared prepared(mesh);
  const Points before = prepared.places(mesh.points);
  Points places = before;
  follow_filtered_normals(prepared.faces, prepared.topology, std::vector<std::uint8_t>(places.size()),
                          std::vector(places.size(), 0.0), places, one_after_the_other);
  EXPECT_TRUE(shapes::same_bits(places, before));
}

// A sheet of which a method has taken noise, and a hill of ten edges.
struct TakenHill {
  static constexpr int kSide = 40;
  double noise = 0.2 / kSide, height = 0.5 / kSide;
  Mesh mesh = meshes::sheet(kSide, Sides::triangles);
  Points input = mesh.points;
  std::vector<double> hill;

  TakenHill() {
    shapes::Random random(5);
    for (Point& p : input) {
      const double squared = std::pow(p.x - 0.5, 2) + std::pow(p.y - 0.5, 2);
      hill.push_back(height * std::exp(-squared / (2 * 0.06 * 0.06)));
      p.z += float(hill.back() + noise * random.normal());
    }
  }
};

TEST(FaceFilter, shape_is_given_back_and_noise_is_not) {
  const TakenHill taken;
  const Prepared prepared(taken.mesh);
  // the order of the vertices is that of the places before
  std::vector<std::uint8_t> stays(taken.input.size());
  const std::uint32_t held = prepared.vertices.of_point[20 * 41 + 20];
  stays[held] = 1;
  const auto in_order = [&](const Points& points) {
    Points result(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) result[prepared.vertices.of_point[i]] = points[i];
    return result;
  };
  Points places = in_order(taken.mesh.points);
  give_back_shape(prepared.faces, stays, std::vector(places.size(), taken.noise), in_order(taken.input), places,
                  one_after_the_other);
  double on_hill = 0, all_of_hill = 0, elsewhere = 0;
  std::size_t moved = 0, flat = 0;
  for (std::size_t i = 0; i < taken.input.size(); ++i) {
    const Point& there = places[prepared.vertices.of_point[i]];
    EXPECT_NEAR(there.x, taken.mesh.points[i].x, 1e-6);
    if (prepared.vertices.of_point[i] == held) {
      EXPECT_EQ(there.z, 0);
    } else if (taken.hill[i] > taken.height / 2) {
      on_hill += there.z, all_of_hill += taken.hill[i];
    } else if (taken.hill[i] < taken.height / 1000) {
      ++flat;
      moved += there.z != 0;
      elsewhere += double(there.z) * there.z;
    }
  }
  EXPECT_GT(on_hill, 0.6 * all_of_hill);
  EXPECT_LT(on_hill, all_of_hill);
  EXPECT_LT(double(moved), 0.1 * double(flat));
  EXPECT_LT(std::sqrt(elsewhere / double(flat)), 0.15 * taken.noise);
}

// One height for each four by four vertices.
TEST(FaceFilter, noise_that_is_correlated_from_vertex_to_vertex_is_no_shape) {
  const Mesh mesh = meshes::sheet(40, Sides::triangles);
  const Prepared prepared(mesh);
  Points input = mesh.points;
  shapes::Random random(8);
  for (int i = 0; i <= 40; i += 4)
    for (int j = 0; j <= 40; j += 4) {
      const float height = float(0.2 / 40 * random.normal());
      for (int a = i; a < std::min(i + 4, 41); ++a)
        for (int b = j; b < std::min(j + 4, 41); ++b) input[std::size_t(a * 41 + b)].z += height;
    }
  Points its_input(input.size()), places(input.size());
  for (std::size_t i = 0; i < input.size(); ++i) {
    its_input[prepared.vertices.of_point[i]] = input[i];
    places[prepared.vertices.of_point[i]] = mesh.points[i];
  }
  const Points before = places;
  give_back_shape(prepared.faces, std::vector<std::uint8_t>(places.size()), std::vector(places.size(), 0.2 / 40),
                  its_input, places, one_after_the_other);
  EXPECT_TRUE(shapes::same_bits(places, before));
}

// Of the normals, in the mean, beside one that evens out alone.
TEST(FaceFilter, a_run_along_a_mesh_leaves_smoother_faces) {
  Mesh mesh = noisy(60, Sides::triangles, 0.3);
  for (Point& p : mesh.points) p.z += 0.1f * std::sin(6 * p.x) * std::cos(5 * p.y);
  const auto angle_of = [&](double share) {
    Params params = meshes::along_mesh();
    params.tangential = share;
    const std::vector<Vec> places = vectors_of(meshes::run(mesh, params).points);
    double sum = 0;
    for (const Face& face : mesh.faces) {
      const Vec middle = (places[face[0]] + places[face[1]] + places[face[2]]) / 3;
      const Vec truth(-0.6 * std::cos(6 * middle.x()) * std::cos(5 * middle.y()),
                      0.5 * std::sin(6 * middle.x()) * std::sin(5 * middle.y()), 1);
      sum += std::acos(std::min(1.0, normal_of(places, face).normalized().dot(truth.normalized())));
    }
    return sum / double(mesh.faces.size());
  };
  EXPECT_LT(angle_of(1), 0.75 * angle_of(0));
}

}  // namespace
}  // namespace pointfair
