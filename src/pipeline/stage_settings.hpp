// SPDX-License-Identifier: Apache-2.0
// What each stage reads of the parameters, so that a change tells which of them must run again.
#pragma once

#include <optional>

#include "estimate/automatic.hpp"
#include "estimate/sensor.hpp"
#include "pointfair/params.hpp"
#include "pointfair/positions.hpp"
#include "seam/backend.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// `given`: the sensor whose place a user or the file says, before the one that was found.
Settings settings_of(const Resolved& used, const KnownSensor& given = {});

// The place of the one sensor that a run reads; nothing where it reads none.
std::optional<Position> one_sensor(const Settings& settings, const Position& origin);

// Whether a run looks for mixed pixels, if it knows the place of the sensor: where outliers are looked for and the two
// nearest neighbours are known.
bool seeks_mixed_pixels(const Params& params);

// Of the index that a run reads. Sums within radii, and those of method implicit, run along the curve.
IndexOrder order_for(const Params& params);

// The first stage that reads something that differs; `iterations` if none does.
Stage first_difference(const Settings& a, const Settings& b);

}  // namespace pointfair
