// SPDX-License-Identifier: Apache-2.0
// A smooth function of place through scattered values.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "pointfair/cloud.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// Levels at the nodes of a grid around most of `places`. A node takes the mean of the logarithms near it; the fewer
// there are, the more a wider surrounding counts. The calls of `for_each` share the work.
NodeLevels levels_between(const std::vector<Point>& places, const std::vector<double>& log_levels,
                          const ForEach& for_each);

// Keeps the memory for the next levels: fresh memory costs more than what is computed in it.
void keep_memory(std::vector<float> levels);
// Shared levels whose memory is kept when the last owner lets them go.
template <class SomeLevels>
std::shared_ptr<SomeLevels> shared(SomeLevels levels) {
  auto owned = std::make_unique<SomeLevels>(std::move(levels));
  return {owned.release(), [](SomeLevels* used) {
            const std::unique_ptr<SomeLevels> last(used);
            keep_memory(std::move(last->levels));
          }};
}

}  // namespace pointfair
