// SPDX-License-Identifier: Apache-2.0
// Coordinates that can take few values only: rounded ones, and depths of a camera that measures whole disparities.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "estimate/nearest_rows.hpp"
#include "point/sample.h"
#include "seam/cloud_sample.hpp"

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

// What the first samples' rows of nearest points show (NearestRows::heads): steps along the axes, of `samples` samples,
// or that planes of one depth face a direction, that of the sensor.
struct StepsInHeads {
  CoordinateSteps steps;
  std::optional<point::Offset> direction;
  // Of axes that have steps each of their own, two at least, where neighbours share all these coordinates: points of a
  // grid or of rows do not lie over each other. 0: none.
  double coarsest = 0;
};
StepsInHeads steps_in_heads(std::span<const Point> heads, std::size_t samples, const ForEach& for_each);

// Asks for the rows of all samples where there is such a direction. Depths have steps if the gaps between levels widen
// with the square of the distance, as those of whole disparities do.
CoordinateSteps coordinate_steps(StepsInHeads in_heads, const NearestRows& nearest, const ForEach& for_each);

}  // namespace pointfair
