// SPDX-License-Identifier: Apache-2.0
#include "mesh/evening.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "mesh/ring_sums.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {
namespace {

using Vec = point::Vec3<double>;

constexpr int kRounds = 5, kMostRounds = 10;      // of untangle()
constexpr double kFarthest = 3;                   // sigmas
constexpr int kRings = 2;                         // whose steps tell a vertex's noise
constexpr double kNoiseOverSteps = 1.2;           // a part of the noise stays
constexpr double kAcross = 1, kMostAcross = 0.5;  // of e

// Of a face: the products A n n^T, which are symmetric, and A; all zero for a face without area.
struct alignas(64) FaceMoment {
  double xx, xy, xz, yy, yz, zz, area;
};
FaceMoment face_moment(std::span<const std::uint32_t> corners, std::span<const Point> places) {
  const Vec normal = face_normal(corners, places);
  const double area = std::sqrt(squared_length(normal));
  if (!(area > 0)) return {};
  const Vec unit = (1 / area) * normal;
  return {unit.x * normal.x,
          unit.x * normal.y,
          unit.x * normal.z,
          unit.y * normal.y,
          unit.y * normal.z,
          unit.z * normal.z,
          area};
}

// Of one vertex: the sums of A n n^T, of A and of the ring. An edge within a mesh has two faces, so each neighbour
// counts twice.
struct Around {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, area = 0;
  Vec ring{};
  double sides = 0;

  void add_face(const FaceMoment& face) {
    xx += face.xx, xy += face.xy, xz += face.xz, yy += face.yy, yz += face.yz, zz += face.zz, area += face.area;
  }
  // w (T + w I)^-1 m, by the adjoint matrix: T is never negative, so the determinant is at least w^3.
  Vec step(Vec here, double w) const {
    if (!(area > 0) || !(sides > 0)) return {};
    const Vec m = (1 / sides) * ring - here;
    const double s = 1 / area, a = s * xx + w, b = s * xy, c = s * xz, d = s * yy + w, e = s * yz, f = s * zz + w;
    const Vec row0 = {d * f - e * e, c * e - b * f, b * e - c * d}, row1 = {row0.y, a * f - c * c, b * c - a * e},
              row2 = {row0.z, row1.z, a * d - b * b};
    const double determinant = a * row0.x + b * row0.y + c * row0.z;
    return determinant > 0 ? (w / determinant) * Vec{dot(row0, m), dot(row1, m), dot(row2, m)} : Vec{};
  }
};

// The sums go in the order of the faces.
template <class MomentOf>
Around look_around(const OrderedFaces& faces, std::span<const Point> places, std::uint32_t v,
                   const MomentOf& moment_of) {
  Around its;
  const std::span<const std::uint32_t> around = faces.around(v);
  const std::span<const OrderedFaces::Beside> beside = faces.beside(v);
  for (std::size_t i = 0; i < around.size(); ++i) {
    its.add_face(moment_of(around[i]));
    its.ring = its.ring + place_of(places, beside[i].after);
    its.ring = its.ring + place_of(places, beside[i].before);
  }
  its.sides = 2 * double(around.size());
  return its;
}

// The e of a vertex with noise sigma.
double across_at(const OrderedFaces& faces, std::span<const Point> places, std::uint32_t v, double sigma) {
  const Vec here = place_of(places, v);
  const std::span<const OrderedFaces::Beside> beside = faces.beside(v);
  double squares = 0;
  for (const OrderedFaces::Beside& its : beside) {
    squares += squared_length(place_of(places, its.after) - here);
    squares += squared_length(place_of(places, its.before) - here);
  }
  const double sides = 2 * double(beside.size());
  return squares > 0 ? std::min(kAcross * sigma * sigma * sides / squares, kMostAcross) : kMostAcross;
}

// Where a vertex is after its step.
Vec stepped(const Around& around, std::span<const Point> places, std::uint32_t v, double share, double across) {
  const Vec here = place_of(places, v);
  return here + share * around.step(here, across);
}

Point to_point(Vec v) { return {float(v.x), float(v.y), float(v.z)}; }

// `to`, or what lies towards it from `from`, no farther than 3 sigma.
Point within_reach(Vec from, Vec to, double sigma) {
  const Vec way = to - from;
  const double length = std::sqrt(squared_length(way)), farthest = kFarthest * sigma;
  return to_point(from + (length > farthest ? farthest / length : 1.0) * way);
}

}  // namespace

platform::LargeVector<double> noise_by_steps(const OrderedFaces& faces, std::span<const std::uint8_t> stays,
                                             double sigma, std::span<const Point> input, std::span<const Point> places,
                                             const ForEach& for_each) {
  struct Steps {
    double squares, count;
    void add(const Steps& other) { squares += other.squares, count += other.count; }
  };
  platform::LargeVector<Steps> steps(places.size());
  for_vertices(places.size(), for_each, [&](std::uint32_t v) {
    const bool counts = stays[v] == 0 && is_indexed(places[v]);
    steps[v] = counts ? Steps{squared_length(place_of(places, v) - place_of(input, v)), 1} : Steps{0, 0};
  });
  sum_over_rings(faces, kRings, steps, for_each);
  platform::LargeVector<double> noise(places.size());
  for_vertices(places.size(), for_each, [&](std::uint32_t v) {
    noise[v] = steps[v].count > 0 ? std::min(sigma, kNoiseOverSteps * std::sqrt(steps[v].squares / steps[v].count)) : 0;
  });
  return noise;
}

void even_out(const OrderedFaces& faces, std::span<const std::uint8_t> stays, double share,
              std::span<const double> noise, std::span<Point> places, const ForEach& for_each) {
  platform::LargeVector<Point> start(places.size()), before(places.size());
  platform::LargeVector<double> across(places.size());
  platform::LargeVector<FaceMoment> moments(faces.size());
  const auto copy_places = [&](std::span<Point> to) {
    for_mesh_blocks(places.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t) {
      std::copy_n(places.data() + first, last - first, to.data() + first);
    });
  };
  copy_places(start);
  for (int round = 0; round < kRounds; ++round) {
    copy_places(before);
    for_mesh_items(faces.size(), for_each, [&](std::size_t f) { moments[f] = face_moment(faces.corners(f), before); });
    for_mesh_items(places.size(), for_each, [&](std::size_t vertex) {
      const auto v = std::uint32_t(vertex);
      if (stays[v] != 0 || !is_indexed(before[v])) return;
      const Around around =
          look_around(faces, before, v, [&](std::uint32_t f) -> const FaceMoment& { return moments[f]; });
      if (round == 0) across[v] = across_at(faces, before, v, noise[v]);
      places[v] = within_reach(place_of(start, v), stepped(around, before, v, share, across[v]), noise[v]);
    });
  }
}

void untangle(Folds& folds, std::span<const std::uint8_t> stays, std::span<const double> noise,
              std::span<Point> places) {
  const OrderedFaces& faces = folds.faces();
  const platform::LargeVector<Point> start(places.begin(), places.end());
  platform::LargeVector<std::uint8_t> moves(places.size(), 0);
  for (int round = 0; round < kMostRounds; ++round) {
    std::vector<std::uint32_t> moved;
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (folds.folded()[f] == 0) continue;
      for (const std::uint32_t v : faces.corners(f)) {
        if (stays[v] != 0 || moves[v] != 0) continue;
        moves[v] = 1;
        moved.push_back(v);
      }
    }
    if (moved.empty()) break;
    std::vector<Point> there;
    const auto moment_of = [&](std::uint32_t f) { return face_moment(faces.corners(f), places); };
    for (const std::uint32_t v : moved)
      there.push_back(within_reach(
          place_of(start, v), stepped(look_around(faces, places, v, moment_of), places, v, 1, kMostAcross), noise[v]));
    for (std::size_t i = 0; i < moved.size(); ++i) places[moved[i]] = there[i], moves[moved[i]] = 0;
    folds.update(places, moved);
  }
}

}  // namespace pointfair
