// SPDX-License-Identifier: Apache-2.0
// A smooth function of place through scattered values.
#pragma once

#include <vector>

#include "pointfair/cloud.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// Levels at the nodes of a grid around most of `places`, for each field of which `log_levels` has a logarithm a place.
// A node takes the mean of the logarithms near it; the fewer there are, the more a wider surrounding counts. The calls
// of `for_each` share the work.
std::vector<NodeLevels> levels_between(const std::vector<Point>& places,
                                       const std::vector<std::vector<double>>& log_levels, const ForEach& for_each);

}  // namespace pointfair
