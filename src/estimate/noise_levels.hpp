// SPDX-License-Identifier: Apache-2.0
// The noise from place to place (docs/how-it-works.md, "Noise from place to place").
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "point/sample.h"
#include "pointfair/cloud.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// What samples say of the noise at their places. `residuals` may be empty: none is looked at.
struct LocalSamples {
  std::span<const Point> places;
  std::span<const point::NoiseSample> noise;
  std::span<const point::ResidualSample> residuals;
  std::span<const std::uint32_t> pools{};  // as of Samples
};

// Levels over `typical`, the noise that is held to be that of a typical place; null where too few samples show noise to
// tell, or where it is 0. Depends on the samples' places but not on their order, but for rounding. O(samples^2), by all
// that `for_each` calls at once.
std::shared_ptr<const NoiseLevels> noise_levels(const LocalSamples& samples, double typical, const ForEach& for_each);

// The levels at 5, 50 and 95 % of some places, at least one.
std::array<double, 3> quantiles_of(std::vector<double> log_levels);

}  // namespace pointfair
