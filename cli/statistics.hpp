// SPDX-License-Identifier: Apache-2.0
// A list of distances in four numbers.
#pragma once

#include <span>
#include <vector>

namespace pointfair::cli {

struct Statistics {
  double mean = 0, rms = 0;
  double p95 = 0;  ///< the least value that 95 % of all values do not exceed
  double max = 0;
};

/// Of non-negative values, which it may reorder; zeros for an empty list. O(N).
Statistics summarize(std::span<double> values);

double median(std::vector<double> values);

}  // namespace pointfair::cli
