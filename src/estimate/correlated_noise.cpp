// SPDX-License-Identifier: Apache-2.0
#include "estimate/correlated_noise.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/moments.hpp"
#include "estimate/quantile.hpp"
#include "estimate/residual_growth.hpp"
#include "estimate/typical_noise.hpp"

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
Heights heights_of(std::span<const Point> row) {
  const std::vector<Offset> offsets = offsets_of(row);
  const std::optional<Offset> normal = robust_normal(offsets);
  if (!normal) return {};
  std::vector<std::pair<double, double>> others;  // squared distance along the plane, height
  for (const Offset& o : offsets) {
    const double height = dot(o, *normal), squared = dot(o, o);
    if (squared > 0) others.emplace_back(squared - height * height, std::abs(height));
  }
  if (others.size() < kFarRanks[1]) return {};
  std::ranges::sort(others);
  Heights heights;
  for (std::size_t rank = 0; rank < kFarRanks[1]; ++rank) {
    if (rank < kNearRank) heights.near.push_back(others[rank].second);
    if (rank >= kFarRanks[0]) heights.far.push_back(others[rank].second);
  }
  return heights;
}

// In flat places, of neighbourhoods of 115 points; endless if there are none.
double widest_residual(std::span<const point::ResidualSample> samples) {
  std::vector<double> known;
  for (const point::ResidualSample& sample : samples)
    if (sample.widest >= 0) known.push_back(sample.widest);
  return known.empty() ? kEndless : quantile(known, kLeastQuantile);
}

}  // namespace

bool neighbors_share_noise(const NearestRows& nearest, double sigma, const ForEach& for_each) {
  constexpr std::size_t kRow = kRepeatNeighbors + 1;
  const std::vector<Point> rows = nearest.of(nearest.looked_at(), kRepeatNeighbors);
  std::vector<Heights> of_rows(rows.size() / kRow);
  for_each(of_rows.size(), [&](std::size_t i) { of_rows[i] = heights_of(std::span(rows).subspan(i * kRow, kRow)); });
  const auto median_of = [&of_rows](std::vector<double> Heights::*which) {
    std::vector<double> all;
    for (const Heights& heights : of_rows) all.insert(all.end(), (heights.*which).begin(), (heights.*which).end());
    return all.empty() ? 0 : median(std::move(all));
  };
  const double near = median_of(&Heights::near), far = median_of(&Heights::far);
  return near < kNearOverFar * far && near < kMostDifference * sigma;
}

bool is_correlated_far(Sampling& from, std::span<const std::uint32_t> queries, double growth,
                       const std::stop_token& stop) {
  const std::span some = queries.first(std::min(queries.size(), kNoiseSamples));
  double at_second = 0;  // residual over the spacing, of every second point
  double at_fourth = 0;  // their growth
  for (const int stride : {2, 4, 8}) {
    const Samples thinned = from.take_samples_by({.stride = stride}, some, stop);
    const Noise noise = noise_of(thinned.noise, false);
    const std::vector<point::ResidualSample> residuals = thinned.residuals();
    const Growth there = residual_growth(residuals);
    const bool is_small = noise.sigma < kMostFarNoise * noise.surface_spacing;
    if (stride < 8 && !(is_small && correlation(residuals) >= kMostlyCorrelated)) return false;
    const bool slows = there.slowing() >= kFarSlowing[0] && there.slowing() <= kFarSlowing[1];
    if (there.flat > growth + kMoreGrowth || (stride > 2 && !slows)) return false;
    if (stride == 4) at_fourth = there.flat;
    if (stride == 8 && there.flat > at_fourth) return false;
    const double over_spacing = widest_residual(residuals) / noise.surface_spacing;
    if (stride == 2) at_second = over_spacing;
    if (stride == 8 && growth < kEndless && over_spacing > kMostOfSecond * at_second) return false;
  }
  return true;
}

}  // namespace pointfair
