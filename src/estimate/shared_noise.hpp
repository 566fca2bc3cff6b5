// SPDX-License-Identifier: Apache-2.0
// Whether neighbours share their noise. Residuals that grow with the neighbourhood, and points that lie close together
// in rows, look as if they did.
#pragma once

#include "estimate/nearest_rows.hpp"

namespace pointfair {

// Whether the nearest points of samples differ less in height than points farther away do, and not by more than noise
// of that standard deviation lets them, as on a bent shape. Asks for rows of the samples that are looked at first.
bool neighbors_share_noise(const NearestRows& nearest, double sigma);

}  // namespace pointfair
