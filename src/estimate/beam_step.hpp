// SPDX-License-Identifier: Apache-2.0
// The angle between neighbouring rays of a sensor whose place is known.
#pragma once

#include <span>
#include <vector>

#include "seam/sampling.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// Of one point.
struct BeamSample {
  double second;  // distance to the second nearest other point
  double range;   // distance to the sensor
};
// At the points of the cloud's sample whose sensor is known. Needs the index of the first iteration.
std::vector<BeamSample> beam_samples(Sampling& from, const CloudSample& sample, const SensorPlaces& sensors);

// In radians: the median of `second` over `range`. However steep a surface is to the rays, its two nearest points lie
// where the range does not change, one step away. 0 where nothing is known, and where the range does not explain the
// distances, which then spread less than the steps: no one sensor saw the cloud from there by turning evenly.
double beam_step(std::span<const BeamSample> samples);

}  // namespace pointfair
