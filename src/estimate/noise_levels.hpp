// SPDX-License-Identifier: Apache-2.0
// The noise from place to place (docs/how-it-works.md, "Noise from place to place").
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "estimate/pools.hpp"
#include "seam/settings.hpp"

namespace pointfair {

struct LocalNoise {
  double typical;                  // the median over the samples
  std::vector<double> at_samples;  // standard deviations
  std::vector<double> log_levels;  // logarithms of these over the typical noise
};

// `typical`: what the noise of a typical place is held to be before places are known, above 0. Depends on the samples'
// places but not on their order, but for rounding.
LocalNoise local_noise(const LocalSamples& samples, double typical, const Pools& pools, const ForEach& for_each);

// The field of levels of which these are the logarithms at some places, at least one.
std::shared_ptr<const NoiseLevels> noise_levels(const std::vector<Point>& places, std::vector<double> log_levels,
                                                const ForEach& for_each);

// The levels at 5, 50 and 95 % of some places, at least one.
std::array<double, 3> quantiles_of(std::vector<double> log_levels);

}  // namespace pointfair
