// SPDX-License-Identifier: Apache-2.0
#include "estimate/residual_growth.hpp"

#include <algorithm>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"
#include "estimate/share_between.hpp"

namespace pointfair {
using namespace constants;

Growth residual_growth(std::span<const point::ResidualSample> samples) {
  const auto growth_at = [&](double share, double most) {
    std::vector<double> from, to;
    for (const point::ResidualSample& s : samples) {
      if (s.narrow < 0 || s.wide < 0 || s.narrow > most) continue;
      from.push_back(s.narrow);
      to.push_back(s.wide);
    }
    if (from.empty()) return 1.0;
    const double low = quantile(from, share), high = quantile(to, share);
    return low > 0 ? high / low : high > 0 ? kEndless : 1;
  };
  std::vector<double> known;
  for (const point::ResidualSample& s : samples)
    if (s.narrow >= 0) known.push_back(s.narrow);
  if (known.empty()) return {};
  const double near_flat = kNearFlat * quantile(known, kLeastQuantile);
  Growth growth{growth_at(kLeastQuantile, kEndless), growth_at(0.5, near_flat)};
  double variance[3] = {};
  for (const point::ResidualSample& s : samples) {
    if (s.narrow < 0 || s.wide < 0 || s.widest < 0) continue;
    if (s.narrow > near_flat || s.widest > kNearFlat * near_flat) continue;
    variance[0] += s.narrow * s.narrow;
    variance[1] += s.wide * s.wide;
    variance[2] += s.widest * s.widest;
  }
  if (variance[0] > 0 && variance[1] > 0) {
    growth.first = variance[1] / variance[0] - 1;
    growth.second = variance[2] / variance[1] - 1;
  }
  return growth;
}

// With the neighbourhood, residuals of shape grow faster and faster, and those of correlated noise ever less. Those
// that fall again saw another sheet or row before.
double correlation(std::span<const point::ResidualSample> samples) {
  const Growth growth = residual_growth(samples);
  return growth.slowing() > 0
             ? share_between(kCorrelatedGrowth, growth.flat) * share_between(kCorrelatedSlowing, growth.slowing())
             : 0;
}

// Variances of noise stay, those of shape grow fourfold: g^2 = (1 + 4 x) / (1 + x).
double shape_to_noise(std::span<const point::ResidualSample> samples) {
  const double growth = residual_growth(samples).typical;
  const double squared = growth * growth / (kOwnGrowth * kOwnGrowth);
  if (squared >= kShapeVarianceGrowth) return kEndless;
  return std::max(0.0, (squared - 1) / (kShapeVarianceGrowth - squared));
}

}  // namespace pointfair
