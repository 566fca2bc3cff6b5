// SPDX-License-Identifier: Apache-2.0
#include "mesh/face_filter.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "mesh/ring_sums.hpp"

namespace pointfair {
namespace {

using Vec = point::Vec3<double>;

constexpr int kFilterRounds = 8, kMoves = 6;
constexpr double kTurn = 2;                               // t_f, in sigma_f / l_f
constexpr double kStep = 1.5;                             // a vertex is a third of the middle of a triangle
constexpr int kRings = 3;                                 // over which what was taken is summed
constexpr double kMeanOf = 20;                            // vertices, in a mesh of triangles of which six meet at each
constexpr double kUncorrelated = 0.3, kCorrelated = 0.6;  // noise of neighbouring vertices that passes for shape
constexpr double kDoubt = 4;                              // squared deviations of a mean that noise explains

using Normal = point::Vec3<float>;

Vec as_doubles(Normal n) { return {n.x, n.y, n.z}; }
Normal as_floats(Vec v) { return {float(v.x), float(v.y), float(v.z)}; }

// What a face's normal is filtered by.
struct FaceWeight {
  float area;
  float turn;  // 1 / t_f^2; 0 without noise, where nothing is filtered
};

Vec unit_or_zero(Vec v) {
  const double length = std::sqrt(squared_length(v));
  return length > 0 ? (1 / length) * v : Vec{};
}

FaceWeight weight_of(std::span<const std::uint32_t> corners, double area, std::span<const double> noise,
                     std::span<const Point> places) {
  double sigma = 0, squares = 0;
  for (std::size_t c = 0; c < corners.size(); ++c) {
    const std::uint32_t before = corners[c == 0 ? corners.size() - 1 : c - 1];
    sigma += noise[corners[c]];
    squares += squared_length(place_of(places, corners[c]) - place_of(places, before));
  }
  const double sides = double(corners.size()), turn = kTurn * sigma / sides;
  return {float(area), turn > 0 ? float(squares / sides / (turn * turn)) : 0};
}

Vec filtered_normal(std::span<const Normal> normals, std::span<const FaceWeight> weights, const OrderedFaces& faces,
                    const MeshTopology& mesh, std::size_t f) {
  const Vec own = as_doubles(normals[f]);
  const double turn = weights[f].turn;
  if (!(turn > 0)) return own;
  Vec sum = double(weights[f].area) * own;
  for (const MeshTopology::Across& across : mesh.across_of(faces, f)) {
    const Vec there = as_doubles(normals[across.face]), normal = across.is_opposite ? Vec{} - there : there;
    const double rest = std::max(0.0, 1 - turn * squared_length(own - normal));
    sum = sum + double(weights[across.face].area) * rest * rest * normal;
  }
  return unit_or_zero(sum);
}

Point to_point(Vec v) { return {float(v.x), float(v.y), float(v.z)}; }

// What was taken along the normals.
struct Taken {
  Normal along;
  float squares, count;  // of vertices that moved
  float all;             // vertices
  void add(const Taken& other) {
    along = along + other.along, squares += other.squares, count += other.count, all += other.all;
  }
};

// Of what was taken from vertices beside each other.
double correlation(const OrderedFaces& faces, std::span<const Taken> taken, const ForEach& for_each) {
  struct Sums {
    double products = 0, squares = 0;
  };
  std::vector<Sums> sums(mesh_blocks(taken.size()));
  for_mesh_blocks(taken.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    Sums its;
    for (auto v = std::uint32_t(first); v < last; ++v) {
      for (const OrderedFaces::Beside& beside : faces.beside(v)) {
        const Taken& there = taken[beside.after];
        its.products += dot(as_doubles(taken[v].along), as_doubles(there.along));
        its.squares += (double(taken[v].squares) + double(there.squares)) / 2;
      }
    }
    sums[block] = its;
  });
  Sums all;
  for (const Sums& its : sums) all.products += its.products, all.squares += its.squares;
  return all.squares > 0 ? all.products / all.squares : 0;
}

}  // namespace

void follow_filtered_normals(const OrderedFaces& faces, const MeshTopology& mesh, std::span<const std::uint8_t> stays,
                             std::span<const double> noise, std::span<Point> places, const ForEach& for_each) {
  platform::LargeVector<Normal> normals(faces.size()), filtered(faces.size());
  platform::LargeVector<FaceWeight> weights(faces.size());
  const auto for_faces = [&](const auto& body) { for_mesh_items(faces.size(), for_each, body); };
  for_faces([&](std::size_t f) {
    const Vec normal = face_normal(faces.corners(f), places);
    normals[f] = as_floats(unit_or_zero(normal));
    weights[f] = weight_of(faces.corners(f), std::sqrt(squared_length(normal)), noise, places);
  });
  for (int round = 0; round < kFilterRounds; ++round) {
    for_faces([&](std::size_t f) { filtered[f] = as_floats(filtered_normal(normals, weights, faces, mesh, f)); });
    normals.swap(filtered);
  }

  platform::LargeVector<double> heights(faces.size());  // n.c of the middle c of each face
  for (int move = 0; move < kMoves; ++move) {
    for_faces([&](std::size_t f) {
      const std::span<const std::uint32_t> corners = faces.corners(f);
      Vec sum{};
      for (const std::uint32_t v : corners) sum = sum + place_of(places, v);
      heights[f] = dot(as_doubles(normals[f]), sum) / double(corners.size());
    });
    // a step reads its own vertex alone, and the others through the heights
    for_vertices(places.size(), for_each, [&](std::uint32_t v) {
      if (stays[v] != 0 || !(noise[v] > 0) || !is_indexed(places[v]) || faces.around(v).empty()) return;
      const Vec here = place_of(places, v);
      Vec sum{};
      for (const std::uint32_t f : faces.around(v)) {
        const Vec normal = as_doubles(normals[f]);
        sum = sum + (heights[f] - dot(normal, here)) * normal;
      }
      places[v] = to_point(here + (kStep / double(faces.around(v).size())) * sum);
    });
  }
}

void give_back_shape(const OrderedFaces& faces, std::span<const std::uint8_t> stays, std::span<const double> noise,
                     std::span<const Point> input, std::span<Point> places, const ForEach& for_each) {
  platform::LargeVector<Normal> normals(places.size());
  platform::LargeVector<Taken> taken(places.size());
  for_vertices(places.size(), for_each, [&](std::uint32_t v) {
    Vec sum{};
    for (const std::uint32_t f : faces.around(v)) sum = sum + face_normal(faces.corners(f), places);
    const Vec normal = unit_or_zero(sum);
    normals[v] = as_floats(normal);
    taken[v] = {{}, 0, 0, 1};
    if (stays[v] != 0 || !is_indexed(places[v])) return;
    const double height = dot(normal, place_of(input, v) - place_of(places, v));
    taken[v] = {as_floats(height * normal), float(height * height), 1, 1};
  });
  const double vertices =
      kMeanOf *
      std::clamp((kCorrelated - correlation(faces, taken, for_each)) / (kCorrelated - kUncorrelated), 0.0, 1.0);
  if (!(vertices > 0)) return;
  sum_over_rings(faces, kRings, taken, for_each);
  for_vertices(places.size(), for_each, [&](std::uint32_t v) {
    const Taken& its = taken[v];
    if (stays[v] != 0 || !(its.count > 0)) return;
    const Vec normal = as_doubles(normals[v]);
    const double count = its.count, mean = dot(as_doubles(its.along), normal) / count,
                 squares = std::min(double(its.squares) / count, noise[v] * noise[v]),
                 share = 1 - kDoubt * double(its.all) / (vertices * count) * squares / (mean * mean);
    if (share > 0) places[v] = to_point(place_of(places, v) + share * mean * normal);
  });
}

}  // namespace pointfair
