// SPDX-License-Identifier: Apache-2.0
// Part of tests/reference.h: vectors, the settings of a run, and neighbours by brute force. Only the order of
// neighbours is decided in float, rounded as the library promises, since neighbour sets must agree exactly.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <tuple>
#include <vector>

#include "estimate/automatic.hpp"
#include "pointfair/params.hpp"
#include "pointfair/pipeline.hpp"
#include "shapes.h"

namespace pointfair::reference {

struct Vec {
  double x = 0, y = 0, z = 0;
};
inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double length(Vec a) { return std::sqrt(dot(a, a)); }
inline Vec to_vec(Point p) { return {p.x, p.y, p.z}; }
using shapes::distance, shapes::rms;
inline Point to_point(Vec v) { return {float(v.x), float(v.y), float(v.z)}; }

// A run with nothing automatic; lengths in file units, 0 for "no limit".
struct Settings {
  int k = 0;
  double radius = 0;
  int min_neighbors = 0;
  bool constraint = false;
  double reach = 0;  // rho + delta
  double normal_sigma = 1, closeness_sigma = 1, similarity_sigma = 1;
  bool normal_of_radius = false,
       closeness_of_radius = false;  // those sigmas are multiples of the neighbourhood's radius
  int filter_rounds = 0;
  double crease_angle = 0, turn_angle = 0;  // degrees; a filter without one is a plain mean
  double flat_scale = 1;                    // of radii in flat places, over their own
  std::vector<float> squared_growth;        // of each point's squared radius; empty: none
  Method method = Method::bilateral;
  bool symmetric = false;
  double strength = 1;
  AreaWeight area_weight = AreaWeight::none;
  int iterations = 1;
  double outlier_distance = 0;  // 0: outliers are not looked for
  double outlier_radius = 0;    // of radius neighbourhoods
  bool pull_outliers = false, hold_back = false;
  double farthest = 0;
  // What follows the noise: levels at nodes, and the share of a step that it justifies.
  std::shared_ptr<const NoiseLevels> levels;
  std::shared_ptr<const NodeLevels> reach_levels;
  float widest = INFINITY;  // radii that neither these levels nor flat places enlarge further
  bool radius_follows = false, similarity_follows = false, farthest_follows = false;
  double level_outlier_distance = 0, noise = 0, damage = 0, trusted = 0;
  bool is_further = false;  // not the first iteration
};

inline Settings settings_of(const Params& resolved) {
  Settings s;
  s.k = resolved.k;
  s.radius = resolved.radius.is_automatic() ? 0 : resolved.radius.value;
  s.constraint = resolved.constraint;
  s.reach = resolved.rho.value + resolved.delta.value;
  s.normal_sigma = resolved.normal_sigma.value;
  s.closeness_sigma = resolved.closeness_sigma.value;
  s.similarity_sigma = resolved.similarity_sigma.value;
  s.min_neighbors = resolved.k == 0 && resolved.min_neighbors > 1 ? resolved.min_neighbors : 0;
  s.normal_of_radius = resolved.normal_sigma.unit == Length::Unit::radius;
  s.closeness_of_radius = resolved.closeness_sigma.unit == Length::Unit::radius;
  const bool bilateral_filter = resolved.normal_filter == NormalFilter::on;
  s.filter_rounds = bilateral_filter ? 2 : resolved.normal_filter == NormalFilter::mollify ? 1 : 0;
  s.crease_angle = bilateral_filter ? resolved.crease_angle : 0;
  if (s.k == 0 && s.filter_rounds > 0 && resolved.method == Method::bilateral)
    s.flat_scale = resolved.flat_scale.value_or(1);
  s.method = resolved.method;
  s.turn_angle = 40;
  s.symmetric = resolved.offset == Offset::symmetric;
  s.strength = resolved.relaxation.value_or(1);
  s.area_weight = resolved.area_weight;
  s.iterations = resolved.iterations;
  s.outlier_distance = resolved.outliers == Outliers::off ? 0 : resolved.outlier_distance.value;
  s.outlier_radius = resolved.outlier_radius.value;
  s.pull_outliers = resolved.outliers == Outliers::move;
  s.hold_back = resolved.outliers == Outliers::keep || resolved.outliers == Outliers::mark;
  s.farthest = resolved.displacement_limit.value;
  return s;
}

// The same with what followed the noise in the run.
inline Settings settings_of(const Params& resolved, const FollowedNoise& followed) {
  Settings s = settings_of(resolved);
  s.levels = followed.levels;
  s.reach_levels = followed.reach_levels;
  s.widest = float(followed.widest);
  s.radius_follows = followed.radius;
  s.similarity_follows = followed.similarity;
  s.farthest_follows = followed.limit;
  s.level_outlier_distance = followed.outlier_distance;
  s.noise = followed.damage > 0 ? resolved.noise.value : 0;
  s.damage = followed.damage;
  s.trusted = followed.trusted;
  if (s.trusted > 0) s.strength = 1;
  return s;
}

// The mean of the eight nodes around the place, each by the volume of the box to the opposite one; outside the grid
// that of the nearest place on it.
inline double level_at(const NodeLevels* levels, Point p) {
  if (levels == nullptr) return 1;
  const int nodes = levels->nodes;
  const Point& first = levels->first;
  const double from[] = {double(p.x) - first.x, double(p.y) - first.y, double(p.z) - first.z};
  double level = 0;
  for (int corner = 0; corner < 8; ++corner) {
    double share = 1;
    int node = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const double place = std::clamp(from[axis] * double(levels->nodes_per_unit), 0.0, nodes - 1.0);
      const int low = std::min(int(place), nodes - 2), at = low + (corner >> axis & 1);
      share *= 1 - std::abs(place - at);
      node = node * nodes + at;
    }
    level += share * double(levels->levels[std::size_t(node)]);
  }
  return level;
}
inline double noise_level(const Settings& s, Point p) { return level_at(s.levels.get(), p); }

using Points = std::vector<Point>;
using List = std::vector<std::uint32_t>;

inline bool is_valid(Point p) {
  return std::abs(p.x) < 1e18f && std::abs(p.y) < 1e18f && std::abs(p.z) < 1e18f;  // false for NaN
}

inline float squared_distance(Point a, Point b) {
  const float x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
  return (x * x + y * y) + z * z;
}

// By x, then by y, then by z.
inline bool lies_before(Point a, Point b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); }

// The nearest `count` other valid points, nearest first, equal distances by position, identical points by index.
inline List nearest(const Points& points, std::size_t i, std::size_t count) {
  struct Candidate {
    float squared;
    std::uint32_t index;
  };
  std::vector<Candidate> candidates;
  for (std::size_t j = 0; j < points.size(); ++j)
    if (j != i && is_valid(points[j])) candidates.push_back({squared_distance(points[i], points[j]), std::uint32_t(j)});
  count = std::min(count, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + std::ptrdiff_t(count), candidates.end(),
                    [&](Candidate a, Candidate b) {
                      if (a.squared != b.squared) return a.squared < b.squared;
                      const Point p = points[a.index], q = points[b.index];
                      return lies_before(p, q) || (!lies_before(q, p) && a.index < b.index);
                    });
  List list;
  for (std::size_t c = 0; c < count; ++c) list.push_back(candidates[c].index);
  return list;
}

// All others within the radius, nearest first.
inline List within(const Points& points, std::size_t i, double radius) {
  const float limit = float(radius) * float(radius);
  List list = nearest(points, i, points.size());
  std::erase_if(list, [&](std::uint32_t j) { return squared_distance(points[i], points[j]) > limit; });
  return list;
}

// q joins N, nearest first, if d(q, N) < rho + delta; N holds the point itself from the start (paper, III.C).
inline List constrained(const Points& points, std::size_t i, const List& candidates, int k, double reach) {
  List members = {std::uint32_t(i)};
  for (const std::uint32_t q : candidates) {
    if (members.size() > std::size_t(k)) break;
    const bool joins = std::any_of(members.begin(), members.end(), [&](std::uint32_t m) {
      return length(to_vec(points[q]) - to_vec(points[m])) < reach;
    });
    if (joins) members.push_back(q);
  }
  members.erase(members.begin());
  return members;
}

// Of the radius that follows the noise.
inline float squared_base_at(Point p, const Settings& s) {
  const float level = s.radius_follows ? float(noise_level(s, p)) : 1.0f;
  return float(s.radius) * float(s.radius) * (level * level);
}

// The squared radius of a neighbourhood that does not grow: rounded as the library does, since it decides who is
// inside.
inline float own_squared_radius(const Points& points, std::size_t i, const Settings& s) {
  const float squared_base = squared_base_at(points[i], s);
  if (s.min_neighbors == 0) return squared_base;
  const List list = nearest(points, i, std::size_t(s.min_neighbors));
  if (list.empty()) return squared_base;
  const float reach_level = float(level_at(s.reach_levels.get(), points[i]));
  const float farthest = squared_distance(points[i], points[list.back()]), reach = reach_level * reach_level * farthest;
  const float least = squared_distance(points[i], points[list[std::min<std::size_t>(list.size(), 8) - 1]]);
  return std::min(std::max(reach, least), std::max(s.widest * s.widest, farthest)) + squared_base;
}

inline float squared_radius(const Points& points, std::size_t i, const Settings& s) {
  return own_squared_radius(points, i, s) * (s.squared_growth.empty() ? 1 : s.squared_growth[i]);
}

// The hash of a point's offset from the least coordinates of the cloud, over [0, 1): of each coordinate's bits as a
// double, the finaliser of MurmurHash3.
inline double share_of_position(const Points& points, std::uint32_t j) {
  Point corner{INFINITY, INFINITY, INFINITY};
  for (const Point& p : points)
    if (is_valid(p)) corner = {std::min(corner.x, p.x), std::min(corner.y, p.y), std::min(corner.z, p.z)};
  std::uint64_t hash = 0x9e3779b97f4a7c15u;
  for (const auto axis : {&Point::x, &Point::y, &Point::z}) {
    const double offset = double(points[j].*axis) - double(corner.*axis);
    hash = (hash ^ std::bit_cast<std::uint64_t>(offset)) * 0xff51afd7ed558ccdu;
    hash ^= hash >> 33;
  }
  hash *= 0xc4ceb9fe1a85ec53u;
  return double(hash >> 40) / 16777216.0;
}

// Which points count in a neighbourhood too full (over 400 by the density at its centre): a share, by a hash of their
// position.
inline bool counts_in_ball(const Points& points, std::uint32_t j, float squared_radius, float own, float squared_base,
                           int min_neighbors) {
  if (min_neighbors == 0 || own <= squared_base) return true;
  const double holds = min_neighbors * double(squared_radius) / double(own - squared_base);
  return holds <= 400 || share_of_position(points, j) < 400 / holds;
}

// All others within the radius, nearest first.
inline List within_radius(const Points& points, std::size_t i, const Settings& s) {
  const float squared = squared_radius(points, i, s), own = own_squared_radius(points, i, s);
  List list = nearest(points, i, points.size());
  std::erase_if(list, [&](std::uint32_t j) {
    return squared_distance(points[i], points[j]) > squared ||
           !counts_in_ball(points, j, squared, own, squared_base_at(points[i], s), s.min_neighbors);
  });
  return list;
}

// N(v_i) without v_i itself.
inline List neighborhood(const Points& points, std::size_t i, const Settings& s) {
  if (!is_valid(points[i])) return {};
  if (s.k == 0) return within_radius(points, i, s);
  const std::size_t limit = s.k == 0 || s.constraint ? points.size() : std::size_t(s.k);
  List list = s.radius > 0 ? within(points, i, s.radius) : nearest(points, i, limit);
  if (s.constraint) return constrained(points, i, list, s.k, s.reach);
  if (s.k > 0 && list.size() > std::size_t(s.k)) list.resize(std::size_t(s.k));
  return list;
}

inline double normal_sigma(const Points& points, std::size_t i, const Settings& s) {
  return s.normal_sigma * (s.normal_of_radius ? std::sqrt(double(squared_radius(points, i, s))) : 1);
}
inline double closeness_sigma(const Points& points, std::size_t i, const Settings& s) {
  return s.closeness_sigma * (s.closeness_of_radius ? std::sqrt(double(squared_radius(points, i, s))) : 1);
}

}  // namespace pointfair::reference
