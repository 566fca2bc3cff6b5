// SPDX-License-Identifier: Apache-2.0
// Coordinates as a LAS file has them: integers, times a scale, plus an offset.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <string>

namespace pointfair::io::las {

using Grid = std::array<std::int32_t, 3>;

struct Scaling {
  std::array<double, 3> scale{}, offset{};
  double value(std::size_t axis, std::int32_t integer) const { return integer * scale[axis] + offset[axis]; }
};

/// The least and the greatest integers of points on each axis.
struct GridBounds {
  Grid min, max;

  GridBounds() {
    min.fill(std::numeric_limits<std::int32_t>::max());
    max.fill(std::numeric_limits<std::int32_t>::min());
  }
  void add(const Grid& lower, const Grid& upper) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      min[axis] = std::min(min[axis], lower[axis]);
      max[axis] = std::max(max[axis], upper[axis]);
    }
  }
  void add(const GridBounds& other) { add(other.min, other.max); }
};

}  // namespace pointfair::io::las
