// SPDX-License-Identifier: Apache-2.0
// Coordinates that can take few values only: rounded ones, and depths of a camera that tells whole disparities.
#pragma once

#include <cstddef>
#include <vector>

#include "estimate/nearest_rows.hpp"

namespace pointfair {

// Rounding moves a point by up to half a step, and hides all noise that is smaller.
struct CoordinateSteps {
  enum class Kind {
    none,
    grid,   // of all coordinates alike
    depth,  // along one direction, ever wider with the distance; rounding there is alike in neighbouring points
  };
  Kind kind = Kind::none;
  std::vector<double> at;  // each sample: the distance between the values there; empty without steps
};

// Asks for a few rows of 500 samples, and for all where they show planes of one depth. A sensor's direction is found by
// them; depths have steps if these widen with the square of the distance, as whole disparities make them.
CoordinateSteps coordinate_steps(NearestRows& nearest);

}  // namespace pointfair
