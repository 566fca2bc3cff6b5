// SPDX-License-Identifier: Apache-2.0
// How wide neighbourhoods are from place to place (docs/how-it-works.md, "Width from place to place").
#pragma once

#include <vector>

#include "estimate/estimate.hpp"
#include "estimate/pools.hpp"

namespace pointfair {

// Logarithms of K of Eq. 23, levels of the distance to the kMinNeighbors-th nearest, at the samples. `noise`: standard
// deviations there, where all have residuals; `surface_points`: of the cloud.
std::vector<double> log_reach_levels(const LocalSamples& samples, const std::vector<double>& noise, int surface_points,
                                     const ForEach& for_each);

}  // namespace pointfair
