// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "pointfair/positions.hpp"

namespace pointfair::io {

struct PlacedArray {
  Cloud cloud;                   ///< as `read` makes it of a binary file of the positions, but without a file
  std::vector<Position> sample;  ///< Source::sample()
};
PlacedArray place_array(std::span<const Position> positions);

}  // namespace pointfair::io
