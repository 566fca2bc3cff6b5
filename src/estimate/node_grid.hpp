// SPDX-License-Identifier: Apache-2.0
// A smooth function of place through scattered values.
#pragma once

#include <memory>
#include <vector>

#include "pointfair/cloud.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// At the nodes of a grid around most of `places`: each node takes the mean of the logarithms near it, and the fewer
// there are the more that of a wider surrounding. By all that `for_each` calls at once.
std::shared_ptr<NoiseLevels> levels_between(const std::vector<Point>& places, const std::vector<double>& log_levels,
                                            const ForEach& for_each);

}  // namespace pointfair
