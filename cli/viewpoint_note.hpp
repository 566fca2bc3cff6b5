// SPDX-License-Identifier: Apache-2.0
// What to say of the place of a sensor that a grid shows or hides.
#pragma once

#include <string>

#include "pointfair/pointfair.hpp"

namespace pointfair::cli {

/// Of an organised cloud without a given viewpoint: where the sensor stood by its grid, or how to say it; else empty.
std::string grid_viewpoint_note(const Cloud& cloud);

}  // namespace pointfair::cli
