// SPDX-License-Identifier: Apache-2.0
// What to say of the places of sensors.
#pragma once

#include <span>
#include <string>

#include "pointfair/pointfair.hpp"

namespace pointfair::cli {

/// A sentence if a sensor stood more than a hundred diagonals outside the bounds of the cloud, as where its place is in
/// another unit or another coordinate system; else empty.
std::string far_viewpoint_note(std::span<const Position> viewpoints, const Cloud& cloud, const Estimates& estimates);

/// Of an organised cloud without a given viewpoint: where the sensor stood by its grid, or how to say it; else empty.
std::string grid_viewpoint_note(const Cloud& cloud);

}  // namespace pointfair::cli
