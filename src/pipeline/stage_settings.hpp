// SPDX-License-Identifier: Apache-2.0
// What each stage reads of the parameters, so that a change tells which of them must run again.
#pragma once

#include <memory>

#include "estimate/automatic.hpp"
#include "pointfair/params.hpp"
#include "seam/backend.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// What is known of the sensor, where a run reads it.
struct KnownSensor {
  std::shared_ptr<const SensorPlaces> places;  // null: nothing
  double beam_width = 0;                       // of the pattern of rays, in radians; 0: not measured
};

Settings settings_of(const Resolved& used, const KnownSensor& sensor = {});

// Whether a run looks for mixed pixels, if it knows the place of the sensor: where outliers are looked for and the two
// nearest neighbours are known.
bool seeks_mixed_pixels(const Params& params);

// Of the index that a run reads. Sums within radii, and those of method implicit, run along the curve.
IndexOrder order_for(const Params& params);

// The first stage that reads something that differs; `iterations` if none does.
Stage first_difference(const Settings& a, const Settings& b);

}  // namespace pointfair
