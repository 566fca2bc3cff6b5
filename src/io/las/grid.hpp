// SPDX-License-Identifier: Apache-2.0
// Coordinates as a LAS file has them: integers, times a scale, plus an offset.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "io/box_of.hpp"

namespace pointfair::io::las {

using Grid = std::array<std::int32_t, 3>;

struct Scaling {
  std::array<double, 3> scale{}, offset{};
  double value(std::size_t axis, std::int32_t integer) const { return integer * scale[axis] + offset[axis]; }
};

using GridBounds = BoxOf<std::int32_t>;

}  // namespace pointfair::io::las
