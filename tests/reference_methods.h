// SPDX-License-Identifier: Apache-2.0
// Part of tests/reference.h: the methods of docs/methods.md.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "reference_neighbors.h"

namespace pointfair::reference {

// What the methods other than the bilateral one (src/point/method.h) know of a cloud.
struct Surroundings {
  const Points& points;
  const std::vector<List>& lists;
  const std::vector<Vec>& normals;  // zero where there is none
  const std::vector<double>& area;
  const Settings& settings;

  Vec offset(std::size_t i, std::uint32_t j) const { return to_vec(points[j]) - to_vec(points[i]); }
  // exp(-distance^2 / 2 sigma_c^2) W_a
  double weight(std::size_t i, std::uint32_t j, double distance) const {
    const double sigma = closeness_sigma(points, i, settings);
    return std::exp(-distance * distance / (2 * sigma * sigma)) * area[j];
  }
  double weight(std::size_t i, std::uint32_t j) const { return weight(i, j, length(offset(i, j))); }
  double similarity(double height) const {
    return std::exp(-height * height / (2 * settings.similarity_sigma * settings.similarity_sigma));
  }
  // of vector(j) over the neighbours; zero for fewer than three
  template <class Vector>
  Vec mean(std::size_t i, Vector vector) const {
    Vec moment;
    double sum = 0;
    for (const std::uint32_t j : lists[i]) {
      moment = moment + weight(i, j) * vector(j);
      sum += weight(i, j);
    }
    return lists[i].size() < 3 || !(sum > 0) ? Vec{} : 1 / sum * moment;
  }
};

// Eq. 11: the umbrella vector.
inline Vec umbrella(const Surroundings& s, std::size_t i) {
  return s.mean(i, [&](std::uint32_t j) { return s.offset(i, j); });
}

// Solves a x = b by Gauss-Jordan elimination with row exchanges.
template <std::size_t N>
std::array<double, N> solved(std::array<std::array<double, N>, N> a, std::array<double, N> b) {
  for (std::size_t p = 0; p < N; ++p) {
    std::size_t best = p;
    for (std::size_t r = p; r < N; ++r)
      if (std::abs(a[r][p]) > std::abs(a[best][p])) best = r;
    std::swap(a[p], a[best]);
    std::swap(b[p], b[best]);
    for (std::size_t r = 0; r < N; ++r) {
      if (r == p) continue;
      const double factor = a[r][p] / a[p][p];
      for (std::size_t c = 0; c < N; ++c) a[r][c] -= factor * a[p][c];
      b[r] -= factor * b[p];
    }
  }
  for (std::size_t p = 0; p < N; ++p) b[p] /= a[p][p];
  return b;
}

// Eq. 16: height of the moving-least-squares polynomial along the normal.
inline double quadric_height(const Surroundings& s, std::size_t i) {
  const Vec n = s.normals[i];
  const double mean_height = dot(n, umbrella(s, i));
  const Vec helper = std::abs(n.x) < 0.6 ? Vec{1, 0, 0} : Vec{0, 1, 0};
  const Vec across = helper - dot(helper, n) * n, u = 1 / length(across) * across;
  const Vec v = {n.y * u.z - n.z * u.y, n.z * u.x - n.x * u.z, n.x * u.y - n.y * u.x};
  const double unit = std::sqrt(2) * closeness_sigma(s.points, i, s.settings);
  std::array<std::array<double, 6>, 6> a{};
  std::array<double, 6> b{};
  List samples = s.lists[i];
  samples.push_back(std::uint32_t(i));
  for (const std::uint32_t j : samples) {
    const Vec from_q = s.offset(i, j) - mean_height * n;
    const double x = dot(u, from_q) / unit, y = dot(v, from_q) / unit, w = s.weight(i, j, length(from_q));
    const std::array<double, 6> terms = {1, x, y, x * x, x * y, y * y};
    for (int r = 0; r < 6; ++r) {
      for (int c = 0; c < 6; ++c) a[r][c] += w * terms[r] * terms[c];
      b[r] += w * terms[r] * dot(n, from_q);
    }
  }
  if (!(a[0][0] > 0)) return 0;
  for (int r = 1; r < 6; ++r) a[r][r] *= 1 + 1e-4;
  return mean_height + solved(a, b)[0];
}

// Eq. 17: the mean of the projections onto the neighbours' planes.
inline Vec mean_predictor(const Surroundings& s, std::size_t i) {
  Vec moment;
  double sum = 0;
  for (const std::uint32_t j : s.lists[i]) {
    const Vec n = s.normals[j];
    if (length(n) == 0) continue;
    const double height = dot(n, s.offset(i, j)), w = s.weight(i, j) * s.similarity(height);
    moment = moment + w * height * n;
    sum += w;
  }
  return s.lists[i].size() < 3 || !(sum > 0) ? Vec{} : 1 / sum * moment;
}

// Eq. 15: the share of the height that noise explains, from the mean square of all heights around the point.
inline double wiener_share(const Surroundings& s, std::size_t i, const std::vector<Vec>& heights) {
  double sum = s.area[i], moment = s.area[i] * dot(heights[i], heights[i]), closeness = 0, squares = 0;
  for (const std::uint32_t j : s.lists[i]) {
    const double w = s.weight(i, j), g = w / s.area[j];
    sum += w;
    moment += w * dot(heights[j], heights[j]);
    closeness += g;
    squares += g * g;
  }
  const double variance = s.settings.similarity_sigma * s.settings.similarity_sigma;
  const double noise = variance * (1 + (closeness > 0 ? squares / (closeness * closeness) : 0));
  return noise / std::max(noise, moment / sum);
}

// How far every point moves by a method other than the bilateral one.
inline std::vector<Vec> displacements(const Surroundings& s) {
  const double step = s.settings.strength;
  std::vector<Vec> first(s.points.size()), result(s.points.size());
  const auto each = [&](std::vector<Vec>& out, auto displacement) {
    for (std::size_t i = 0; i < out.size(); ++i)
      if (is_valid(s.points[i])) out[i] = displacement(i);
  };
  const auto of_neighbors = [&](std::size_t i) { return s.mean(i, [&](std::uint32_t j) { return first[j]; }); };
  switch (s.settings.method) {
    case Method::bilateral:
    case Method::learned:
    case Method::implicit:   // test_implicit.cpp
    case Method::fleishman:  // test_mesh_methods.cpp
    case Method::jones:      // the same
      break;
    case Method::laplacian:
      each(result, [&](std::size_t i) { return step * umbrella(s, i); });
      break;
    case Method::taubin: {  // the second step's umbrella vectors are of the points that the first has moved
      each(first, [&](std::size_t i) { return step * umbrella(s, i); });
      const double mu = 1 / (0.1 - 1 / step);
      each(result, [&](std::size_t i) {
        const Vec second = s.mean(i, [&](std::uint32_t j) { return s.offset(i, j) + first[j] - first[i]; });
        return first[i] + mu * second;
      });
      break;
    }
    case Method::hc_laplacian:
      each(first, [&](std::size_t i) { return step * umbrella(s, i); });
      each(result, [&](std::size_t i) { return first[i] - (0.5 * first[i] + 0.5 * of_neighbors(i)); });
      break;
    case Method::mls:
      each(result, [&](std::size_t i) {
        const Vec n = s.normals[i];
        return length(n) > 0 ? step * quadric_height(s, i) * n : Vec{};
      });
      break;
    case Method::wiener:
      each(first, [&](std::size_t i) { return dot(s.normals[i], umbrella(s, i)) * s.normals[i]; });
      each(result, [&](std::size_t i) { return step * wiener_share(s, i, first) * first[i]; });
      break;
    case Method::mollified:
      each(result, [&](std::size_t i) { return step * mean_predictor(s, i); });
      break;
  }
  return result;
}

}  // namespace pointfair::reference
