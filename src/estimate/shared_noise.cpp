// SPDX-License-Identifier: Apache-2.0
#include "estimate/shared_noise.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/moments.hpp"
#include "estimate/quantile.hpp"

namespace pointfair {
namespace {

using namespace constants;
using point::Offset;

// Of the plane of most points: those that lie far off it tilt the plane of all. None where they lie along a line.
std::optional<Offset> robust_normal(std::span<const Offset> offsets) {
  std::vector<Offset> kept(offsets.begin(), offsets.end());
  for (int round = 0;; ++round) {
    const Moments moments(kept);
    const auto normal = point::least_eigenvector(moments.second);
    if (!normal.exists || moments.lie_along_a_line()) return std::nullopt;
    if (round == kPlaneRounds) return normal.unit;
    std::vector<double> heights;
    for (const Offset& o : offsets) heights.push_back(std::abs(dot(o - moments.centroid, normal.unit)));
    const double most = kFarOffPlane * median(heights);
    kept.clear();
    for (std::size_t i = 0; i < offsets.size(); ++i)
      if (heights[i] <= most) kept.push_back(offsets[i]);
  }
}

// How far points lie above or below samples: the nearest ones, and others farther away.
struct Heights {
  std::vector<double> near, far;
};

// Nearest are those along the plane, since the nearest in space have nearly the same height.
void add_heights(std::span<const Point> row, Heights& heights) {
  const std::vector<Offset> offsets = offsets_of(row);
  const std::optional<Offset> normal = robust_normal(offsets);
  if (!normal) return;
  std::vector<std::pair<double, double>> others;  // squared distance along the plane, height
  for (const Offset& o : offsets) {
    const double height = dot(o, *normal), squared = dot(o, o);
    if (squared > 0) others.emplace_back(squared - height * height, std::abs(height));
  }
  if (others.size() < kFarRanks[1]) return;
  std::ranges::sort(others);
  for (std::size_t rank = 0; rank < kFarRanks[1]; ++rank) {
    if (rank < kNearRank) heights.near.push_back(others[rank].second);
    if (rank >= kFarRanks[0]) heights.far.push_back(others[rank].second);
  }
}

}  // namespace

bool neighbors_share_noise(const NearestRows& nearest, double sigma) {
  constexpr std::size_t kRow = kRepeatNeighbors + 1;
  const std::vector<Point> rows = nearest.of(nearest.looked_at(), kRepeatNeighbors);
  Heights heights;
  for (std::size_t first = 0; first < rows.size(); first += kRow)
    add_heights(std::span(rows).subspan(first, kRow), heights);
  if (heights.near.empty()) return false;
  const double near = median(std::move(heights.near)), far = median(std::move(heights.far));
  return near < kNearOverFar * far && near < kMostDifference * sigma;
}

}  // namespace pointfair
