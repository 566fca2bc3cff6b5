// SPDX-License-Identifier: Apache-2.0
#include "mesh/folds.hpp"

#include <algorithm>
#include <numeric>

#include "mesh/face_corners.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {
namespace {

using Vec = point::Vec3<double>;

constexpr int kMostHalvings = 6;

Vec place(std::span<const Point> points, std::uint32_t at) { return {points[at].x, points[at].y, points[at].z}; }

// The first corner is the least.
void rotate_to_least(std::vector<std::uint32_t>& ranks) {
  std::rotate(ranks.begin(), std::min_element(ranks.begin(), ranks.end()), ranks.end());
}

// A side of a face, from the vertex of lower rank to the other.
struct Side {
  std::uint32_t low, high, face;
  bool is_forward;
};

}  // namespace

OrderedFaces::OrderedFaces(std::span<const Point> points, std::span<const std::uint32_t> vertex,
                           const Polygons& faces) {
  std::vector<std::uint32_t> order, rank(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i)
    if (vertex[i] == i && is_indexed(points[i])) order.push_back(i);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return point::lies_before(to_vec3(points[a]), to_vec3(points[b]));
  });
  for (std::uint32_t r = 0; r < order.size(); ++r) rank[order[r]] = r;

  std::vector<std::vector<std::uint32_t>> of_faces;
  FaceCorners each(points, faces, vertex);
  each.for_each([&](std::span<const std::uint32_t> corners) {
    std::vector<std::uint32_t> ranks(corners.size());
    std::transform(corners.begin(), corners.end(), ranks.begin(), [&](std::uint32_t at) { return rank[at]; });
    rotate_to_least(ranks);
    of_faces.push_back(std::move(ranks));
  });
  std::sort(of_faces.begin(), of_faces.end());
  for (const std::vector<std::uint32_t>& ranks : of_faces) {
    for (const std::uint32_t r : ranks) faces_.corners.push_back(order[r]);
    faces_.ends.push_back(faces_.corners.size());
  }
  find_neighbors();
}

void OrderedFaces::find_neighbors() {
  std::vector<Side> sides;
  sides.reserve(faces_.corners.size());
  for (std::size_t f = 0; f < size(); ++f) {
    const auto its = corners(f);
    for (std::size_t i = 0; i < its.size(); ++i) {
      const std::uint32_t a = its[i], b = its[i + 1 < its.size() ? i + 1 : 0];
      sides.push_back({std::min(a, b), std::max(a, b), std::uint32_t(f), a < b});
    }
  }
  std::stable_sort(sides.begin(), sides.end(),
                   [](const Side& s, const Side& t) { return s.low != t.low ? s.low < t.low : s.high < t.high; });
  struct Pair {
    std::uint32_t face;
    Across across;
  };
  std::vector<Pair> pairs;
  faces_.encloses = size() > 0;
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high) ++end;
    if (end - begin != 2) {  // a border, or an edge of many faces: nothing lies across
      faces_.encloses = false;
      continue;
    }
    const Side &s = sides[begin], &t = sides[begin + 1];
    const bool is_opposite = s.is_forward == t.is_forward;
    if (is_opposite) faces_.encloses = false;
    pairs.push_back({s.face, {t.face, is_opposite}});
    pairs.push_back({t.face, {s.face, is_opposite}});
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& p, const Pair& q) {
    return p.face != q.face ? p.face < q.face : p.across.face < q.across.face;
  });
  across_begin_.assign(size() + 1, 0);
  for (const Pair& pair : pairs) {
    ++across_begin_[pair.face + 1];
    across_.push_back(pair.across);
  }
  std::partial_sum(across_begin_.begin(), across_begin_.end(), across_begin_.begin());
}

// Twice the area long.
std::vector<Vec> OrderedFaces::area_normals(std::span<const Point> points) const {
  std::vector<Vec> normals(size());
  for (std::size_t f = 0; f < size(); ++f) {
    const auto its = corners(f);
    const Vec first = place(points, its[0]);
    Vec sum{};
    for (std::size_t i = 2; i < its.size(); ++i)
      sum = sum + cross(place(points, its[i - 1]) - first, place(points, its[i]) - first);
    normals[f] = sum;
  }
  return normals;
}

std::vector<Vec> OrderedFaces::filtered(const std::vector<Vec>& normals) const {
  std::vector<Vec> sums(size());
  for (std::size_t f = 0; f < size(); ++f) {
    Vec sum = normals[f];
    for (std::size_t i = across_begin_[f]; i < across_begin_[f + 1]; ++i) {
      const Vec there = normals[across_[i].face];
      sum = across_[i].is_opposite ? sum - there : sum + there;
    }
    sums[f] = sum;
  }
  return sums;
}

std::vector<std::uint8_t> OrderedFaces::folded(std::span<const Point> points) const {
  const std::vector<Vec> normals = area_normals(points), wide = filtered(filtered(normals));
  std::vector<std::uint8_t> result(size());
  for (std::size_t f = 0; f < size(); ++f) result[f] = dot(normals[f], wide[f]) < 0;
  return result;
}

std::vector<std::uint8_t> unfold(const OrderedFaces& faces, std::span<const std::uint32_t> vertex,
                                 std::span<const std::uint8_t> folded_before, std::span<const Point> before,
                                 std::span<Point> after) {
  std::vector<std::uint8_t> halvings(after.size());
  const std::vector<Point> whole(after.begin(), after.end());
  for (;;) {
    std::vector<std::uint8_t> folded = faces.folded(after), shortens(after.size());
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (folded[f] == 0 || folded_before[f] != 0) continue;
      for (const std::uint32_t v : faces.corners(f)) shortens[v] = halvings[v] <= kMostHalvings;
    }
    if (std::find(shortens.begin(), shortens.end(), 1) == shortens.end()) return folded;
    for (std::size_t i = 0; i < after.size(); ++i) {
      const std::uint32_t v = vertex[i];
      if (shortens[v] == 0) continue;
      if (v == i) ++halvings[v];
    }
    for (std::size_t i = 0; i < after.size(); ++i) {
      const std::uint32_t v = vertex[i];
      if (shortens[v] == 0) continue;
      const float share = halvings[v] > kMostHalvings ? 0.0f : 1.0f / float(1 << halvings[v]);
      after[i] = {before[i].x + share * (whole[i].x - before[i].x), before[i].y + share * (whole[i].y - before[i].y),
                  before[i].z + share * (whole[i].z - before[i].z)};
    }
  }
}

}  // namespace pointfair
