// SPDX-License-Identifier: Apache-2.0
// The method in the plainest code: every equation in double precision, every search by brute force, nothing shared with
// src/point.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "reference_methods.h"
#include "reference_neighbors.h"

namespace pointfair::reference {

using Matrix = std::array<std::array<double, 3>, 3>;

struct Eigen3 {
  std::array<double, 3> values;  // rising
  std::array<Vec, 3> vectors;
};

// One rotation of Jacobi's method in the plane of axes p and q: m[p][q] becomes 0, v collects the rotation.
inline void rotate(Matrix& m, Matrix& v, int p, int q) {
  if (m[p][q] == 0) return;
  const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
  const double t = (theta < 0 ? -1 : 1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
  const double c = 1 / std::sqrt(t * t + 1), s = t * c;
  const auto turn = [c, s](double& a, double& b) {
    const double old_a = a;
    a = c * a - s * b;
    b = s * old_a + c * b;
  };
  for (int r = 0; r < 3; ++r) turn(m[r][p], m[r][q]);
  for (int r = 0; r < 3; ++r) turn(m[p][r], m[q][r]);
  for (int r = 0; r < 3; ++r) turn(v[r][p], v[r][q]);
}

inline Eigen3 eigen(Matrix m) {
  Matrix v = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int sweep = 0; sweep < 20; ++sweep) {
    rotate(m, v, 0, 1);
    rotate(m, v, 0, 2);
    rotate(m, v, 1, 2);
  }
  std::array<int, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(), [&](int a, int b) { return m[a][a] < m[b][b]; });
  Eigen3 result{};
  for (int i = 0; i < 3; ++i) {
    const int c = order[i];
    result.values[i] = m[c][c];
    result.vectors[i] = {v[0][c], v[1][c], v[2][c]};
  }
  return result;
}

// The normal, and how well the data determines it: the gap of the two least eigenvalues over their sum.
struct Normal {
  Vec unit;
  double gap = 0;
};

// Of an exponent: a Gaussian of lists, and within a radius what nears one (Eq. 26).
inline double kernel(double t, const Settings& s) {
  return s.k > 0 ? std::exp(-t) : t < 17 * 15 / 16.0 ? std::pow(1 - t / 17, 16) : 0;
}

// Paper eq. 3-5; eq. 4 normalised by its weights.
inline Normal normal(const Points& points, std::size_t i, const List& list, const Settings& s) {
  const double sigma = normal_sigma(points, i, s);
  const auto weight = [&](double x) { return kernel(x * x / (2 * sigma * sigma), s); };
  const auto squared_weight = [&](double x) { return kernel(x * x / (sigma * sigma), s); };
  const Vec here = to_vec(points[i]);
  Vec moment;
  double sum = 0;
  for (const std::uint32_t j : list) {
    const double w = weight(length(to_vec(points[j]) - here));
    moment = moment + w * (to_vec(points[j]) - here);
    sum += w;
  }
  const Vec centroid = here + 1 / sum * moment;
  Matrix m{};
  for (const std::uint32_t j : list) {
    const Vec d = to_vec(points[j]) - centroid;
    const double w = squared_weight(length(d)), own[3] = {d.x, d.y, d.z};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) m[r][c] += w * own[r] * own[c];
  }
  const double trace = m[0][0] + m[1][1] + m[2][2];
  if (!(trace > 0)) return {};
  const Eigen3 e = eigen(m);
  return {e.vectors[0], (e.values[1] - e.values[0]) / trace};
}

// W_a: mean distance to the 5 nearest, or a power of it (paper, III.E).
inline std::vector<double> area_weights(const Points& points, AreaWeight kind) {
  std::vector<double> result(points.size(), 1.0);
  if (kind == AreaWeight::none) return result;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const List list = is_valid(points[i]) ? nearest(points, i, 5) : List{};
    double sum = 0;
    for (const std::uint32_t j : list) sum += length(to_vec(points[j]) - to_vec(points[i]));
    const double mean = list.empty() ? 0 : sum / double(list.size());
    result[i] = kind == AreaWeight::squared ? mean * mean : mean;
  }
  return result;
}

// The exponent of a normal that makes this angle's cosine with another, signs aside.
inline double turn_exponent(double cosine, double degrees) {
  if (degrees == 0) return 0;
  const double turn = (1 - std::abs(cosine)) / (1 - std::cos(degrees * 3.14159265358979 / 180));
  return turn * turn;
}

// Of the filter of normals and of iterations after the first, where the reach differs from place to place (Eq. 24).
inline double further_share(Point p, const Settings& s) {
  if (!s.reach_levels) return 1;
  return std::clamp((20 * std::pow(level_at(s.reach_levels.get(), p), 2) - 8) / (14 - 8), 0.0, 1.0);
}

// One round of bilateral filtering of the normals (Eq. 9); points without a normal take no part.
inline std::vector<Normal> filtered(const std::vector<Normal>& normals, const Points& points,
                                    const std::vector<List>& lists, const Settings& s) {
  std::vector<Normal> result = normals;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Vec n = normals[i].unit;
    if (length(n) == 0) continue;
    const double sigma = normal_sigma(points, i, s);
    Vec sum = n;
    for (const std::uint32_t j : lists[i]) {
      const double cosine = dot(n, normals[j].unit), distance = length(to_vec(points[j]) - to_vec(points[i]));
      const double w = kernel(distance * distance / (2 * sigma * sigma) + turn_exponent(cosine, s.crease_angle), s);
      sum = sum + (cosine < 0 ? -w : w) * normals[j].unit;
    }
    const Vec mixed = n + further_share(points[i], s) * (1 / length(sum) * sum - n);
    result[i].unit = 1 / length(mixed) * mixed;
    for (const std::uint32_t j : lists[i]) result[i].gap = std::min(result[i].gap, normals[j].gap);
  }
  return result;
}

// What Eq. 20 multiplies squared radii by, from the normals that the last round of the filter reads.
inline std::vector<float> squared_growth(const Points& points, const std::vector<Normal>& normals,
                                         const std::vector<List>& lists, const Settings& s) {
  std::vector<float> result;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    if (!is_valid(points[i])) {
      result.push_back(1);
      continue;
    }
    double turn = 0;
    for (const std::uint32_t j : lists[i]) turn += 1 - std::abs(dot(normals[i].unit, normals[j].unit));
    const double mean = lists[i].empty() ? 1 : turn / double(lists[i].size());
    const double share = std::clamp((0.003 - mean) / (0.003 - 0.001), 0.0, 1.0);
    const float growth = float(1 + (s.flat_scale * s.flat_scale - 1) * share);
    result.push_back(std::max(1.0f, std::min(growth, s.widest * s.widest / own_squared_radius(points, i, s))));
  }
  return result;
}

// What Wiener's filter leaves of a displacement, by the two-pass variance of the neighbours' heights over the plane.
inline double noise_share(const Points& points, std::size_t i, const List& list, Vec normal, const Settings& s) {
  if (list.empty()) return 1;
  std::vector<double> heights;
  for (const std::uint32_t j : list) heights.push_back(dot(normal, to_vec(points[j]) - to_vec(points[i])));
  double mean = 0, variance = 0;
  for (const double height : heights) mean += height / double(heights.size());
  for (const double height : heights) variance += (height - mean) * (height - mean) / double(heights.size());
  const double noise = std::pow(s.noise * noise_level(s, points[i]), 2);
  const double shape = std::max(0.0, variance - ((s.is_further ? 0.1 : 1.0) + 0.3) * noise);
  const double doubt = s.trusted * s.trusted / noise;
  return noise / (noise + s.damage * shape) / (1 + doubt * doubt);
}

// Paper eq. 6 (eq. 2 where all area weights are 1), or Eq. 10 with both planes; 0 if no neighbour has weight.
inline double displacement(const Points& points, std::size_t i, const List& list, const std::vector<Normal>& normals,
                           const Settings& s, const std::vector<double>& area) {
  const double closeness = closeness_sigma(points, i, s);
  const Vec n = normals[i].unit;
  const double similarity = s.similarity_sigma * (s.similarity_follows ? noise_level(s, points[i]) : 1);
  double moment = 0, sum = 0;
  for (const std::uint32_t j : list) {
    const Vec offset = to_vec(points[i]) - to_vec(points[j]);
    double height = dot(n, offset), compared = height, facing = 0;
    if (s.symmetric) {
      const double cosine = dot(n, normals[j].unit);
      compared = (cosine < 0 ? -1 : 1) * dot(normals[j].unit, offset);
      height = (height + compared) / 2;
      facing = turn_exponent(cosine, s.turn_angle);
    }
    const double distance = length(offset);
    const double w = kernel(distance * distance / (2 * closeness * closeness) +
                                compared * compared / (2 * similarity * similarity) + facing,
                            s) *
                     area[j];
    moment += w * height;
    sum += w;
  }
  const double share =
      (s.noise > 0 ? noise_share(points, i, list, n, s) : 1) * (s.is_further ? further_share(points[i], s) : 1);
  return s.strength * share * (sum > 0 ? moment / sum : 0);
}

inline double outlier_distance(Point p, const Settings& s) {
  return std::max(s.outlier_distance, s.level_outlier_distance * noise_level(s, p));
}

// Off the surface: hardly a neighbour is near the point's plane, or, in a neighbourhood that is far wider than others,
// many are not; or all of a radius neighbourhood's are near its rim.
inline bool is_outlier(const Points& points, std::size_t i, const List& list, Vec normal, const Settings& s) {
  const double most = outlier_distance(points[i], s), core = most * most;
  const bool is_sparse = s.k == 0 && squared_radius(points, i, s) > s.outlier_radius * s.outlier_radius;
  const double slab = is_sparse ? std::max(most, 0.15 * std::sqrt(squared_radius(points, i, s))) : most;
  double near_plane = 0, near = 0;
  for (const std::uint32_t j : list) {
    const Vec offset = to_vec(points[j]) - to_vec(points[i]);
    near_plane += std::abs(dot(normal, offset)) <= slab;
    near += s.k > 0 || dot(offset, offset) <= std::max(0.75 * squared_radius(points, i, s), core);
  }
  const float all = float(list.size()), least = is_sparse ? 0.7f : 0.1f;  // a tenth of thirty is three in floats only
  return s.outlier_distance > 0 && (float(near_plane) < least * all || float(near) < (is_sparse ? 0.3f : 0.05f) * all);
}

// From the point to the mean of its neighbours, weighted by closeness in a list, by the sixth power of the inverse
// radius of their own neighbourhoods within a radius.
inline Vec to_mean(const Points& points, std::size_t i, const List& list, const Settings& s) {
  const double closeness = closeness_sigma(points, i, s), here = s.k > 0 ? 0 : squared_radius(points, i, s);
  Vec moment;
  double sum = 0;
  for (const std::uint32_t j : list) {
    const Vec offset = to_vec(points[j]) - to_vec(points[i]);
    const double w = s.k > 0 ? std::exp(-dot(offset, offset) / (2 * closeness * closeness))
                             : std::pow(here / std::max(double(squared_radius(points, j, s)), 1e-6 * here), 3);
    moment = moment + w * offset;
    sum += w;
  }
  return 1 / sum * moment;
}

// One faired point.
struct Faired {
  Vec position;
  Normal normal;  // zero gap: no normal
  std::size_t neighbors = 0;
  bool is_outlier = false;
  bool grows_in_part = false;  // its radius, in some iteration, so that rounding decides on points at the rim
  bool reads_part = false;     // of a neighbour in an iteration before
};

inline constexpr double kLeastGap = 1e-5;  // below it points count as a line

// Paper eq. 1 for every point, from the old positions.
inline std::vector<Faired> fair_once(const Points& points, const Settings& s) {
  const std::vector<double> area = area_weights(points, s.area_weight);
  std::vector<List> lists(points.size());
  std::vector<Normal> normals(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_valid(points[i])) continue;
    lists[i] = neighborhood(points, i, s);
    if (lists[i].size() >= 3) normals[i] = normal(points, i, lists[i], s);
    if (normals[i].gap < kLeastGap) normals[i] = {};
  }
  Settings of_step = s;
  std::vector<List> step_lists = lists;
  for (int round = 0; round < s.filter_rounds; ++round) {
    if (round + 1 == s.filter_rounds && s.flat_scale > 1) {
      of_step.squared_growth = squared_growth(points, normals, lists, s);
      for (std::size_t i = 0; i < points.size(); ++i) step_lists[i] = neighborhood(points, i, of_step);
    }
    normals = filtered(normals, points, lists, s);
  }
  std::vector<Faired> result(points.size());
  const bool is_bilateral = s.method == Method::bilateral;
  std::vector<Vec> units;
  for (const Normal& n : normals) units.push_back(n.unit);
  const std::vector<Vec> moves = displacements({points, lists, units, area, s});
  for (std::size_t i = 0; i < points.size(); ++i) {
    result[i] = {to_vec(points[i]) + moves[i], normals[i], lists[i].size()};
    const float growth = of_step.squared_growth.empty() ? 1 : of_step.squared_growth[i];
    result[i].grows_in_part = growth > 1 && growth < float(s.flat_scale * s.flat_scale);
    const Vec n = normals[i].unit;
    if (!is_bilateral || length(n) == 0) continue;
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    if (!is_outlier(points, i, step_lists[i], n, of_step)) {
      result[i].position = to_vec(points[i]) - displacement(points, i, step_lists[i], normals, of_step, area) * n;
    } else if (s.pull_outliers) {
      result[i].position = to_vec(points[i]) + s.strength * to_mean(points, i, step_lists[i], s);
    } else {
      result[i].position = {kNan, kNan, kNan};
    }
  }
  return result;
}

// All iterations; positions are rounded to float between them, as the library stores them.
inline std::vector<Faired> fair(Points points, Settings s) {
  const Points start = points;
  std::vector<Faired> result;
  for (int iteration = 0; iteration < s.iterations; ++iteration) {
    s.is_further = iteration > 0;
    const std::vector<Faired> before = std::exchange(result, fair_once(points, s));
    for (std::size_t i = 0; i < before.size(); ++i) {
      result[i].grows_in_part |= before[i].grows_in_part;
      for (const std::uint32_t j : neighborhood(points, i, s)) result[i].reads_part |= before[j].grows_in_part;
    }
    for (std::size_t i = 0; i < points.size(); ++i) points[i] = to_point(result[i].position);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_valid(start[i]) || !(s.hold_back || s.iterations > 1)) continue;
    const Vec from = to_vec(start[i]), step = result[i].position - from;
    const double moved = length(step);
    const double farthest = s.farthest * (s.farthest_follows ? noise_level(s, start[i]) : 1);
    result[i].is_outlier =
        !is_valid(points[i]) || (s.hold_back && moved > std::max(farthest, outlier_distance(start[i], s)));
    if (result[i].is_outlier) {
      result[i].position = from;
    } else if (s.hold_back && moved > farthest) {
      const double share = farthest / moved;
      result[i].position = from + share * share * step;
    }
  }
  return result;
}

// Mean distance to the 6 nearest.
inline double spacing(const Points& points) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_valid(points[i])) continue;
    for (const std::uint32_t j : nearest(points, i, 6)) {
      sum += length(to_vec(points[j]) - to_vec(points[i]));
      ++count;
    }
  }
  return count == 0 ? 0 : sum / double(count);
}

}  // namespace pointfair::reference
