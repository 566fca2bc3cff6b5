// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

namespace pointfair::io {

/// The least and the greatest coordinates on each axis of what was added.
template <class Number>
struct BoxOf {
  std::array<Number, 3> min, max;

  BoxOf() {
    using Limits = std::numeric_limits<Number>;
    min.fill(Limits::has_infinity ? Limits::infinity() : Limits::max());
    max.fill(Limits::has_infinity ? -Limits::infinity() : Limits::min());
  }
  bool is_empty() const { return !(min[0] <= max[0]); }
  void add(const std::array<Number, 3>& low, const std::array<Number, 3>& high) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      min[axis] = std::min(min[axis], low[axis]);
      max[axis] = std::max(max[axis], high[axis]);
    }
  }
  void add(const std::array<Number, 3>& point) { add(point, point); }
  void add(const BoxOf& other) { add(other.min, other.max); }
};

}  // namespace pointfair::io
