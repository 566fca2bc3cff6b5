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
constexpr double kTurn = 2;                         // t_f, in sigma_f / l_f
constexpr double kStep = 1.5;                       // a vertex is a third of the middle of a triangle
constexpr int kRings = 3;                           // over which what was taken is summed
constexpr double kMeanOf = 20;                      // vertices, in a mesh of triangles of which six meet at each
constexpr double kLittleAlike = 0.3, kAlike = 0.6;  // noise that is alike from vertex to vertex passes for shape
constexpr double kDoubt = 4;                        // squared deviations of a mean that noise explains

// Of a face: its normal, and its area or, once normals are filtered, n.c of its middle c.
struct FacePlane {
  float x, y, z;
  float turn;  // 1 / t_f^2
  double size;

  Vec normal() const { return {x, y, z}; }
};

void set_normal(FacePlane& plane, Vec unit) {
  plane.x = float(unit.x), plane.y = float(unit.y), plane.z = float(unit.z);
}

Vec unit_or_zero(Vec v) {
  const double length = std::sqrt(squared_length(v));
  return length > 0 ? (1 / length) * v : Vec{};
}

FacePlane plane_of(std::span<const std::uint32_t> corners, std::span<const double> noise,
                   std::span<const Point> places) {
  double sigma = 0, squares = 0;
  for (std::size_t c = 0; c < corners.size(); ++c) {
    const std::uint32_t before = corners[c == 0 ? corners.size() - 1 : c - 1];
    sigma += noise[corners[c]];
    squares += squared_length(place_of(places, corners[c]) - place_of(places, before));
  }
  const double sides = double(corners.size());
  sigma /= sides, squares /= sides;
  const Vec normal = face_normal(corners, places);
  const double area = std::sqrt(squared_length(normal)), squared_turn = kTurn * kTurn * sigma * sigma;
  FacePlane plane{};
  if (!(area > 0)) return plane;
  set_normal(plane, (1 / area) * normal);
  plane.size = area;
  plane.turn = squared_turn > 0 ? float(squares / squared_turn) : 0;  // without noise, nothing is filtered
  return plane;
}

Vec filtered_normal(std::span<const FacePlane> planes, const OrderedFaces& faces, const MeshTopology& mesh,
                    std::size_t f) {
  const FacePlane& own = planes[f];
  if (!(own.turn > 0)) return own.normal();
  Vec sum = own.size * own.normal();
  for (const MeshTopology::Across& across : mesh.across_of(faces, f)) {
    const FacePlane& there = planes[across.face];
    const Vec normal = across.is_opposite ? Vec{} - there.normal() : there.normal();
    const double rest = std::max(0.0, 1 - double(own.turn) * squared_length(own.normal() - normal));
    sum = sum + there.size * rest * rest * normal;
  }
  return unit_or_zero(sum);
}

Point to_point(Vec v) { return {float(v.x), float(v.y), float(v.z)}; }

// What was taken along the normals.
struct Taken {
  Vec along;
  double squares, count;  // of vertices that moved
  double all;             // vertices
  void add(const Taken& other) {
    along = along + other.along, squares += other.squares, count += other.count, all += other.all;
  }
};

// How alike what was taken from vertices beside each other is: their correlation.
double likeness(const OrderedFaces& faces, std::span<const Taken> taken, const ForEach& for_each) {
  struct Sums {
    double products = 0, squares = 0;
  };
  std::vector<Sums> sums(mesh_blocks(taken.size()));
  for_mesh_blocks(taken.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    Sums its;
    for (auto v = std::uint32_t(first); v < last; ++v) {
      for (const OrderedFaces::Beside& beside : faces.beside(v)) {
        const Taken& there = taken[beside.after];
        its.products += dot(taken[v].along, there.along);
        its.squares += (taken[v].squares + there.squares) / 2;
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
  platform::LargeVector<FacePlane> planes(faces.size()), filtered(faces.size());
  const auto for_faces = [&](const auto& body) {
    for_mesh_blocks(faces.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t f = first; f < last; ++f) body(f);
    });
  };
  for_faces([&](std::size_t f) { planes[f] = plane_of(faces.corners(f), noise, places); });
  for (int round = 0; round < kFilterRounds; ++round) {
    for_faces([&](std::size_t f) {
      filtered[f] = planes[f];
      set_normal(filtered[f], filtered_normal(planes, faces, mesh, f));
    });
    planes.swap(filtered);
  }

  platform::LargeVector<Point> next(places.size());
  for (int move = 0; move < kMoves; ++move) {
    for_faces([&](std::size_t f) {
      const std::span<const std::uint32_t> corners = faces.corners(f);
      Vec sum{};
      for (const std::uint32_t v : corners) sum = sum + place_of(places, v);
      planes[f].size = dot(planes[f].normal(), sum) / double(corners.size());
    });
    for_vertices(places.size(), for_each, [&](std::uint32_t v) {
      next[v] = places[v];
      if (stays[v] != 0 || !(noise[v] > 0) || !is_indexed(places[v]) || faces.around(v).empty()) return;
      const Vec here = place_of(places, v);
      Vec sum{};
      for (const std::uint32_t f : faces.around(v))
        sum = sum + (planes[f].size - dot(planes[f].normal(), here)) * planes[f].normal();
      next[v] = to_point(here + (kStep / double(faces.around(v).size())) * sum);
    });
    for_vertices(places.size(), for_each, [&](std::uint32_t v) { places[v] = next[v]; });
  }
}

void give_back_shape(const OrderedFaces& faces, std::span<const std::uint8_t> stays, std::span<const double> noise,
                     std::span<const Point> input, std::span<Point> places, const ForEach& for_each) {
  platform::LargeVector<Vec> normals(places.size());
  platform::LargeVector<Taken> taken(places.size());
  for_vertices(places.size(), for_each, [&](std::uint32_t v) {
    Vec sum{};
    for (const std::uint32_t f : faces.around(v)) sum = sum + face_normal(faces.corners(f), places);
    normals[v] = unit_or_zero(sum);
    taken[v] = {{}, 0, 0, 1};
    if (stays[v] != 0 || !is_indexed(places[v])) return;
    const double height = dot(normals[v], place_of(input, v) - place_of(places, v));
    taken[v] = {height * normals[v], height * height, 1, 1};
  });
  const double vertices =
      kMeanOf * std::clamp((kAlike - likeness(faces, taken, for_each)) / (kAlike - kLittleAlike), 0.0, 1.0);
  if (!(vertices > 0)) return;
  sum_over_rings(faces, kRings, taken, for_each);
  for_vertices(places.size(), for_each, [&](std::uint32_t v) {
    const Taken& its = taken[v];
    if (stays[v] != 0 || !(its.count > 0)) return;
    const double mean = dot(its.along, normals[v]) / its.count,
                 squares = std::min(its.squares / its.count, noise[v] * noise[v]),
                 share = 1 - kDoubt * its.all / (vertices * its.count) * squares / (mean * mean);
    if (share > 0) places[v] = to_point(place_of(places, v) + share * mean * normals[v]);
  });
}

}  // namespace pointfair
