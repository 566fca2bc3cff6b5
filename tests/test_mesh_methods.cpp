// SPDX-License-Identifier: Apache-2.0
// Method::fleishman and Method::jones against the algorithms of their papers in the plainest code: nothing is shared
// with src.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "meshes.h"
#include "pointfair/pipeline.hpp"
#include "reference.h"
#include "runs.h"

namespace pointfair {
namespace {

using meshes::Face;
using meshes::Mesh;
using meshes::Result;
using meshes::Sides;
using reference::Vec;

Params fleishman(int iterations) {
  return {.connectivity = Connectivity::mesh, .method = Method::fleishman, .iterations = iterations};
}

// A wavy sheet with noise, little enough that no step folds a face.
Mesh waves(int n, Sides sides, double noise = 0.08, std::uint64_t seed = 5) {
  Mesh mesh = meshes::sheet(n, sides);
  const auto height = [](float x, float y) { return 0.1 * std::sin(5 * x) * std::cos(4 * y); };
  mesh.points = shapes::with_noise(shapes::lifted(mesh.points, height), noise / n, seed);
  return mesh;
}

std::vector<Vec> places_of(const Mesh& mesh) {
  std::vector<Vec> places;
  for (const Point& p : mesh.points) places.push_back(reference::to_vec(p));
  return places;
}

// Twice the area long.
Vec normal_of(const std::vector<Vec>& places, const Face& face) {
  Vec sum{};
  for (std::size_t i = 0; i < face.size(); ++i)
    sum = sum + cross(places[face[i]] - places[face[0]], places[face[(i + 1) % face.size()]] - places[face[0]]);
  return sum;
}

std::vector<Vec> vertex_normals(const std::vector<Vec>& places, const std::vector<Face>& faces) {
  std::vector<Vec> normals(places.size());
  for (const Face& face : faces)
    for (const std::uint32_t v : face) normals[v] = normals[v] + normal_of(places, face);
  for (Vec& n : normals) n = 1 / reference::length(n) * n;
  return normals;
}

// The vertices that edges reach within `radius`.
std::vector<std::vector<std::uint32_t>> neighborhoods(const std::vector<Vec>& places, const Mesh& mesh, double radius) {
  const auto rings = meshes::rings_of(mesh);
  std::vector<std::vector<std::uint32_t>> result(places.size());
  for (std::uint32_t v = 0; v < places.size(); ++v) {
    std::set<std::uint32_t> seen{v};
    std::deque<std::uint32_t> waiting{v};
    for (; !waiting.empty(); waiting.pop_front())
      for (const std::uint32_t there : rings[waiting.front()])
        if (reference::length(places[there] - places[v]) <= radius && seen.insert(there).second)
          waiting.push_back(there);
    seen.erase(v);
    result[v].assign(seen.begin(), seen.end());
  }
  return result;
}

struct Sigmas {
  double closeness, similarity;
};

std::vector<Vec> published(const Mesh& mesh, Sigmas sigmas, int iterations) {
  const std::vector<bool> boundary = meshes::boundary_of(mesh);
  std::vector<Vec> now = places_of(mesh);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const std::vector<Vec> normals = vertex_normals(now, mesh.faces);
    const auto around = neighborhoods(now, mesh, 2 * sigmas.closeness);
    std::vector<Vec> next = now;
    for (std::size_t v = 0; v < now.size(); ++v) {
      if (boundary[v]) continue;
      double sum = 0, normalizer = 0;
      for (const std::uint32_t q : around[v]) {
        const double t = reference::length(now[v] - now[q]), h = dot(normals[v], now[q] - now[v]);
        const double w = std::exp(-t * t / (2 * sigmas.closeness * sigmas.closeness)) *
                         std::exp(-h * h / (2 * sigmas.similarity * sigmas.similarity));
        sum += w * h;
        normalizer += w;
      }
      if (normalizer > 0) next[v] = now[v] + sum / normalizer * normals[v];
    }
    now = next;
  }
  return now;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Of the vertices within the mesh: the radius of the two-ring, and the deviation of the heights in it.
Sigmas measured(const Mesh& mesh) {
  const std::vector<Vec> places = places_of(mesh);
  const auto rings = meshes::rings_of(mesh);
  const std::vector<bool> boundary = meshes::boundary_of(mesh);
  std::vector<double> radii;
  for (std::size_t v = 0; v < places.size(); ++v) {
    if (boundary[v]) continue;
    double farthest = 0;
    for (const std::uint32_t first : rings[v])
      for (const std::uint32_t second : rings[first])
        farthest = std::max(
            {farthest, reference::length(places[first] - places[v]), reference::length(places[second] - places[v])});
    radii.push_back(farthest);
  }
  const double radius = median(radii);
  const std::vector<Vec> normals = vertex_normals(places, mesh.faces);
  const auto around = neighborhoods(places, mesh, radius);
  std::vector<double> deviations;
  for (std::size_t v = 0; v < places.size(); ++v) {
    if (boundary[v]) continue;
    double sum = 0, squares = 0;
    for (const std::uint32_t q : around[v]) sum += dot(normals[v], places[q] - places[v]);
    const double mean = sum / double(around[v].size());
    for (const std::uint32_t q : around[v]) squares += std::pow(dot(normals[v], places[q] - places[v]) - mean, 2);
    deviations.push_back(std::sqrt(squares / double(around[v].size())));
  }
  return {radius / 2, median(deviations)};
}

void expect_near(const Result& result, const Mesh& mesh, const std::vector<Vec>& expected, double off) {
  EXPECT_EQ(result.report.mesh.folded_after, 0u);
  double farthest = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_LT(reference::length(reference::to_vec(result.points[i]) - expected[i]), off) << "point " << i;
    farthest = std::max(farthest, reference::length(expected[i] - reference::to_vec(mesh.points[i])));
  }
  EXPECT_GT(farthest, 1e-3);
}

TEST(Fleishman, is_the_published_algorithm) {
  for (const Sides sides : {Sides::triangles, Sides::quads, Sides::mixed}) {
    const Mesh mesh = waves(16, sides);
    Params params = fleishman(3);
    params.closeness_sigma = 0.07;
    params.similarity_sigma = 0.01;
    const Result result = run(mesh, params);
    EXPECT_DOUBLE_EQ(result.report.params.radius.value, 0.14);
    expect_near(result, mesh, published(mesh, {0.07, 0.01}, 3), 2e-6);
  }
}

TEST(Fleishman, sigmas_are_those_of_a_typical_two_ring) {
  const Mesh mesh = waves(30, Sides::triangles);
  const Sigmas expected = measured(mesh);
  const Params used = run(mesh, fleishman(1)).report.params;
  EXPECT_NEAR(used.closeness_sigma.value, expected.closeness, 1e-6 * expected.closeness);
  EXPECT_NEAR(used.similarity_sigma.value, expected.similarity, 1e-5 * expected.similarity);
  EXPECT_NEAR(used.radius.value, 2 * expected.closeness, 1e-6);
  Params wider = fleishman(1);
  wider.radius = 0.2;
  EXPECT_DOUBLE_EQ(run(mesh, wider).report.params.closeness_sigma.value, 0.1);
}

TEST(Fleishman, leaves_less_noise_and_keeps_an_edge) {
  Mesh mesh = meshes::sheet(40, Sides::triangles);
  shapes::Random random(8);
  const auto roof = [](double x) { return 0.5 * std::abs(x - 0.5); };
  for (Point& p : mesh.points) p.z = float(roof(p.x) + 0.2 / 40 * random.normal());
  const auto off = [&](const shapes::Points& points, bool at_edge) {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (at_edge != (std::abs(mesh.points[i].x - 0.5f) < 0.03f)) continue;
      sum += std::pow(points[i].z - roof(points[i].x), 2);
      ++count;
    }
    return std::sqrt(sum / count);
  };
  const shapes::Points after = run(mesh, fleishman(3)).points;
  EXPECT_LT(off(after, false), 0.6 * off(mesh.points, false));
  EXPECT_LT(off(after, true), off(mesh.points, true));
}

TEST(Fleishman, the_order_of_points_and_faces_and_threads_change_no_bit) {
  const Mesh mesh = waves(24, Sides::mixed, 0.3);
  const auto order = shapes::shuffle_order(mesh.points.size(), 3);
  const Result one = run(mesh, fleishman(2), 1), other = run(meshes::shuffled(mesh, order), fleishman(2), 3);
  EXPECT_TRUE(shapes::same_bits(shapes::permuted(one.points, order), other.points));
}

TEST(Fleishman, a_plane_without_noise_stays) {
  const Mesh plane = meshes::sheet(12, Sides::quads);
  EXPECT_TRUE(shapes::same_bits(run(plane, fleishman(2)).points, plane.points));
}

Params jones() { return {.connectivity = Connectivity::mesh, .method = Method::jones}; }

// Predictions of faces with a corner among what edges reach within 2 sigma_f, whose middles lie as near.
std::vector<Vec> predicted(const Mesh& mesh, double sigma_f, double sigma_g) {
  const std::vector<Vec> places = places_of(mesh);
  const auto around = neighborhoods(places, mesh, 2 * sigma_f);
  const std::vector<bool> boundary = meshes::boundary_of(mesh);
  std::vector<Vec> middles, normals;
  std::vector<double> areas;
  for (const Face& face : mesh.faces) {
    Vec sum{};
    for (const std::uint32_t v : face) sum = sum + places[v];
    middles.push_back(1 / double(face.size()) * sum);
    areas.push_back(reference::length(normal_of(places, face)) / 2);
  }
  const auto for_faces = [&](std::size_t v, double reach, const auto& visit) {
    std::set<std::uint32_t> near(around[v].begin(), around[v].end());
    near.insert(std::uint32_t(v));
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const bool meets = std::any_of(mesh.faces[f].begin(), mesh.faces[f].end(),
                                     [&](std::uint32_t corner) { return near.count(corner) > 0; });
      if (meets && reference::length(middles[f] - places[v]) <= reach) visit(f);
    }
  };
  const auto gauss = [](double x, double sigma) { return std::exp(-x * x / (2 * sigma * sigma)); };
  std::vector<Vec> smooth = places, result = places;
  for (std::size_t v = 0; v < places.size(); ++v) {
    Vec sum{};
    double weights = 0;
    for_faces(v, sigma_f, [&](std::size_t f) {
      const double w = areas[f] * gauss(reference::length(middles[f] - places[v]), sigma_f / 2);
      sum = sum + w * middles[f];
      weights += w;
    });
    if (weights > 0) smooth[v] = 1 / weights * sum;
  }
  for (const Face& face : mesh.faces) {
    const Vec normal = normal_of(smooth, face);
    normals.push_back(1 / reference::length(normal) * normal);
  }
  for (std::size_t v = 0; v < places.size(); ++v) {
    if (boundary[v]) continue;
    Vec sum{};
    double weights = 0;
    for_faces(v, 2 * sigma_f, [&](std::size_t f) {
      const double height = dot(normals[f], middles[f] - places[v]);
      const Vec projection = places[v] + height * normals[f];
      const double w = areas[f] * gauss(reference::length(middles[f] - places[v]), sigma_f) * gauss(height, sigma_g);
      sum = sum + w * projection;
      weights += w;
    });
    result[v] = 1 / weights * sum;
  }
  return result;
}

TEST(Jones, is_the_published_algorithm) {
  for (const Sides sides : {Sides::triangles, Sides::quads, Sides::mixed}) {
    const Mesh mesh = waves(14, sides);
    Params params = jones();
    params.closeness_sigma = 0.1;
    params.similarity_sigma = 0.02;
    const Result result = run(mesh, params);
    expect_near(result, mesh, predicted(mesh, 0.1, 0.02), 1e-6);
  }
}

TEST(Jones, the_order_of_faces_seams_and_threads_change_no_bit) {
  const Mesh mesh = waves(20, Sides::mixed, 0.3);
  const auto order = shapes::shuffle_order(mesh.points.size(), 3);
  const Result one = run(mesh, jones(), 1), other = run(meshes::shuffled(mesh, order), jones(), 3);
  EXPECT_TRUE(shapes::same_bits(shapes::permuted(one.points, order), other.points));
  const shapes::Points parts = run(meshes::unwelded(mesh), jones(), 2).points;
  EXPECT_TRUE(shapes::same_bits(meshes::unwelded({one.points, mesh.faces}).points, parts));
}

TEST(Fleishman, what_cannot_be_is_said_in_one_line) {
  const auto refused = [](const Params& params, const std::string& part) {
    expect_error(ErrorKind::usage, part, [&] { run(waves(4, Sides::triangles), params); });
  };
  Params as_cloud = fleishman(1);
  as_cloud.connectivity = Connectivity::points;
  refused(as_cloud, "add --connectivity mesh");
  as_cloud.method = Method::jones;
  refused(as_cloud, "--method jones reads faces");
  Params in_radii = fleishman(1);
  in_radii.closeness_sigma = Length(0.5, Length::Unit::radius);
  refused(in_radii, "other than r");
}

}  // namespace
}  // namespace pointfair
