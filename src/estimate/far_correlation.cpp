// SPDX-License-Identifier: Apache-2.0
#include "estimate/far_correlation.hpp"

#include <algorithm>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"
#include "estimate/residual_growth.hpp"
#include "estimate/typical_noise.hpp"

namespace pointfair {
using namespace constants;

namespace {

// In flat places, of neighbourhoods of 115 points; endless if there are none.
double widest_residual(std::span<const point::ResidualSample> samples) {
  std::vector<double> known;
  for (const point::ResidualSample& sample : samples)
    if (sample.widest >= 0) known.push_back(sample.widest);
  return known.empty() ? kEndless : quantile(known, kLeastQuantile);
}

}  // namespace

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
