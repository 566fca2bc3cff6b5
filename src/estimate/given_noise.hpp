// SPDX-License-Identifier: Apache-2.0
// The noise from place to place as someone knows it, in place of what is measured.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "estimate/estimate.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/settings.hpp"

namespace pointfair {

struct GivenNoise {
  double sigma = 0;  // at a typical place: the median
  std::shared_ptr<const NoiseLevels> levels{};
};

// What else was measured stays. Places without a surface have the noise that is given for them.
Noise with_given(Noise measured, const GivenNoise& given);

// Levels between the values at a sample of points, one for each of them; `sigma` is the median of all values.
GivenNoise given_noise(double sigma, const CloudSample& sample, std::span<const float> values, const ForEach& for_each);

// The noise of standard deviations, one for each of `points`. Values that are not positive and finite, and those of
// invalid points, do not count; none if no value counts. Levels lie between the values at a sample of the points. O(N)
// on the host, with the same bits for points in any order if points at one place have one value.
std::optional<GivenNoise> given_noise(std::span<const float> values, std::span<const Point> points,
                                      const ForEach& for_each);

}  // namespace pointfair
