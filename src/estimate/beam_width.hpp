// SPDX-License-Identifier: Apache-2.0
// The width of the pattern of rays of a sensor whose place is known (point/sensor.h).
#pragma once

#include <span>
#include <vector>

#include "seam/sampling.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// Of one point.
struct BeamSample {
  double second, twelfth;  // distance to the so many nearest other point
  double range;            // distance to the sensor
};
// At the points of the cloud's sample whose sensor is known. Needs the index of the first iteration.
std::vector<BeamSample> beam_samples(Sampling& from, const CloudSample& sample, const SensorPlaces& sensors);

// In radians: the median of `twelfth` over `range`. 0 where nothing is known, and where the range does not explain the
// distances: the two nearest points of one on a surface lie where the range does not change, one step between rays
// away, however steep the surface is, so where distances to the second spread less than these steps, no one sensor saw
// the cloud from there by turning evenly.
double beam_width(std::span<const BeamSample> samples);

}  // namespace pointfair
