// SPDX-License-Identifier: Apache-2.0
// Rules that set in by degrees.
#pragma once

#include <algorithm>

namespace pointfair {

// 0 at `from` and before, 1 at `to` and beyond, straight between; `from` may be the larger of the two.
inline double share_between(double from, double to, double value) {
  return std::clamp((value - from) / (to - from), 0.0, 1.0);
}
inline double share_between(const double (&ends)[2], double value) { return share_between(ends[0], ends[1], value); }

}  // namespace pointfair
