// SPDX-License-Identifier: Apache-2.0
// Coordinates that can take few values only: rounded ones, and depths of a camera that tells whole disparities.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"

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

inline constexpr int kStepNeighbors = 8;
// Of rows of samples and their kStepNeighbors nearest others (Sampling::sample_neighborhoods). O(samples log samples).
CoordinateSteps coordinate_steps(std::span<const Point> rows);

}  // namespace pointfair
