// SPDX-License-Identifier: Apache-2.0
// Cameras that match images or patterns, told by how their noise grows with the distance.
#pragma once

#include <span>

#include "estimate/nearest_rows.hpp"
#include "point/sample.h"

namespace pointfair {

// Whether residuals grow as the noise of a sensor that triangulates: with the square of the distance from it, to which
// the steps between its pixels are proportional. Noise of a time of flight hardly grows, and residuals of shape grow
// with the steps themselves or, where the shape is smooth, with their cube. The samples are the first of the rows.
bool errs_by_triangulation(std::span<const point::ResidualSample> samples, const NearestRows& nearest);

}  // namespace pointfair
