// SPDX-License-Identifier: Apache-2.0
// The noise from place to place (docs/how-it-works.md, "Noise from place to place").
#pragma once

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

// `typical`: the noise of a typical place by Eq. 8, above 0. `most`: by Eq. 25, for all places. The result does not
// depend on the order of the samples, except by rounding.
LocalNoise local_noise(const LocalSamples& samples, double typical, double most, const ForEach& for_each);

// The field of levels whose logarithms at some places, at least one, are `log_levels`.
std::shared_ptr<const NoiseLevels> noise_levels(const std::vector<Point>& places, std::vector<double> log_levels,
                                                const ForEach& for_each);
// The same, of levels that were found already.
std::shared_ptr<const NoiseLevels> noise_levels(NodeLevels levels, const std::vector<double>& log_levels);

}  // namespace pointfair
