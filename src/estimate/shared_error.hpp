// SPDX-License-Identifier: Apache-2.0
// Noise that the nearest points have in common and farther ones have not, as that of a lidar whose rings are off from
// each other. Residuals of small neighbourhoods, which hold one ring, are far too small. They jump to the noise where
// neighbourhoods reach other rings, and stay there. Residuals of shape go on growing.
#pragma once

#include <vector>

#include "point/sample.h"

namespace pointfair {

// Whether residuals jump from some size of neighbourhood to the next.
bool residuals_jump(const std::vector<point::ResidualSample>& residuals);

// Whether the residuals of a thinned cloud with this surface spacing are noise: they stay what they are from one size
// to the next, and are no rounding of a clean surface.
bool residuals_stay(const std::vector<point::ResidualSample>& thinned, double spacing);

}  // namespace pointfair
