// SPDX-License-Identifier: Apache-2.0
// How wide neighbourhoods are from place to place (docs/how-it-works.md, "Width from place to place").
#pragma once

#include <memory>
#include <vector>

#include "estimate/estimate.hpp"
#include "estimate/pools.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// K of Eq. 23: levels of the distance to the kMinNeighbors-th nearest. `noise`: standard deviations at the samples, all
// of which have residuals; `surface_points`: of the cloud.
std::shared_ptr<const NodeLevels> reach_levels(const LocalSamples& samples, const std::vector<double>& noise,
                                               int surface_points, const ForEach& for_each);

}  // namespace pointfair
