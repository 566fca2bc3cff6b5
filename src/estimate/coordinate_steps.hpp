// SPDX-License-Identifier: Apache-2.0
// Coordinates that can take few values only: rounded ones, and depths of a camera that measures whole disparities.
#pragma once

#include <cstddef>
#include <vector>

#include "estimate/nearest_rows.hpp"

namespace pointfair {

// Rounding moves a point by up to half a step, and hides all noise that is smaller.
struct CoordinateSteps {
  enum class Kind {
    none,
    grid,   // the same along each axis
    depth,  // along one direction, ever wider with the distance; their rounding is correlated between neighbours
  };
  Kind kind = Kind::none;
  std::vector<double> at;  // the step at each sample; empty without steps
};

// Asks for the rows of some samples, and for the rows of all where the first show planes of one depth. Those planes
// give the direction to the sensor. Depths have steps if the gaps between levels widen with the square of the distance,
// as those of whole disparities do.
CoordinateSteps coordinate_steps(NearestRows& nearest);

}  // namespace pointfair
