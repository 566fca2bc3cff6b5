// SPDX-License-Identifier: Apache-2.0
#include "mesh/evening.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "seam/cloud_sample.hpp"

namespace pointfair {
namespace {

using Vec = point::Vec3<double>;

constexpr int kRounds = 5, kMostRounds = 10;      // of untangle()
constexpr double kFarthest = 3;                   // sigmas
constexpr double kAcross = 1, kMostAcross = 0.5;  // of e

// Of one vertex: the sums of A n n^T, of A, of the ring and of its squared edges. An edge within a mesh has two faces,
// so each neighbour counts twice.
struct Around {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, area = 0;
  Vec ring{};
  double sides = 0, squares = 0;

  // `normal` is as long as the area.
  void add_face(Vec normal, double its_area) {
    const Vec unit = (1 / its_area) * normal;
    xx += unit.x * normal.x, xy += unit.x * normal.y, xz += unit.x * normal.z;
    yy += unit.y * normal.y, yz += unit.y * normal.z, zz += unit.z * normal.z;
    area += its_area;
  }
  void add_side(Vec here, Vec there) {
    ring = ring + there;
    squares += squared_length(there - here);
    ++sides;
  }
  double across(double sigma) const {
    return squares > 0 ? std::min(kAcross * sigma * sigma * sides / squares, kMostAcross) : kMostAcross;
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

Vec place(std::span<const Point> points, std::uint32_t at) { return {points[at].x, points[at].y, points[at].z}; }

std::vector<Around> look_around(const OrderedFaces& faces, std::span<const Point> points) {
  std::vector<Around> around(points.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto corners = faces.corners(f);
    const Vec first = place(points, corners[0]);
    Vec normal{};
    for (std::size_t i = 2; i < corners.size(); ++i)
      normal = normal + cross(place(points, corners[i - 1]) - first, place(points, corners[i]) - first);
    const double area = std::sqrt(squared_length(normal));
    for (std::size_t i = 0; i < corners.size(); ++i) {
      Around& its = around[corners[i]];
      const Vec here = place(points, corners[i]);
      if (area > 0) its.add_face(normal, area);
      its.add_side(here, place(points, corners[i + 1 < corners.size() ? i + 1 : 0]));
      its.add_side(here, place(points, corners[i > 0 ? i - 1 : corners.size() - 1]));
    }
  }
  return around;
}

// Where a vertex is after its step.
Vec stepped(const Around& around, std::span<const Point> points, std::uint32_t v, double share, double across) {
  const Vec here = place(points, v);
  return here + share * around.step(here, across);
}

Point to_point(Vec v) { return {float(v.x), float(v.y), float(v.z)}; }

// Points at one place have the place of their vertex.
void follow_vertices(std::span<const std::uint32_t> vertex, std::span<const std::uint8_t> stays,
                     std::span<Point> points) {
  for (std::size_t i = 0; i < points.size(); ++i)
    if (stays[i] == 0) points[i] = points[vertex[i]];
}

}  // namespace

void even_out(const OrderedFaces& faces, std::span<const std::uint32_t> vertex, std::span<const std::uint8_t> stays,
              double share, double sigma, std::span<Point> points) {
  const std::vector<Point> start(points.begin(), points.end());
  const double farthest = kFarthest * sigma;
  std::vector<double> across;
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<Around> around = look_around(faces, points);
    if (round == 0)
      for (const Around& its : around) across.push_back(its.across(sigma));
    for (std::uint32_t v = 0; v < points.size(); ++v) {
      if (stays[v] != 0 || vertex[v] != v || !is_indexed(points[v])) continue;
      const Vec from = place(start, v), way = stepped(around[v], points, v, share, across[v]) - from;
      const double length = std::sqrt(squared_length(way));
      points[v] = to_point(from + (length > farthest ? farthest / length : 1.0) * way);
    }
    follow_vertices(vertex, stays, points);
  }
}

void untangle(const OrderedFaces& faces, std::span<const std::uint32_t> vertex, std::span<const std::uint8_t> stays,
              std::span<Point> points) {
  for (int round = 0; round < kMostRounds; ++round) {
    const std::vector<std::uint8_t> folded = faces.folded(points);
    std::vector<std::uint8_t> moves(points.size());
    for (std::size_t f = 0; f < faces.size(); ++f)
      for (const std::uint32_t v : faces.corners(f)) moves[v] |= folded[f];
    if (std::find(moves.begin(), moves.end(), 1) == moves.end()) return;
    const std::vector<Around> around = look_around(faces, points);
    for (std::uint32_t v = 0; v < points.size(); ++v)
      if (moves[v] != 0 && stays[v] == 0) points[v] = to_point(stepped(around[v], points, v, 1, kMostAcross));
    follow_vertices(vertex, stays, points);
  }
}

}  // namespace pointfair
