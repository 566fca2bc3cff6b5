// SPDX-License-Identifier: Apache-2.0
// The parameters that follow from what was measured of the cloud.
#pragma once

#include "estimate/estimate.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

// Replaces each `auto` by what follows from the spacing and noise, and every length by file units.
Params resolve_params(const Params& params, const Spacing& spacing, const Noise& noise, double diagonal);

// Whether sums run over balls and not over lists.
bool sums_balls(const Params& params);

// Whether `resolve_params` would look at the spacing, at the noise, at the diagonal.
bool needs_spacing(const Params& params);
bool needs_noise(const Params& params);
bool needs_diagonal(const Params& params);

}  // namespace pointfair
