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
  double second, twelfth;  // distances to the second and the twelfth nearest other point
  double range;            // distance to the sensor
};
// At the points of the cloud's sample whose sensor is known. Needs the index of the first iteration.
std::vector<BeamSample> beam_samples(Sampling& from, const CloudSample& sample, const SensorPlaces& sensors);

// The width of the pattern in radians: the median of `twelfth` over `range`. 0 where no sample has a sensor.
// Also 0 where the place of the sensor does not explain the distances. A sensor that turns evenly sees every point of a
// surface with its second neighbour one step of the rays away, however steep the surface is, so `second` over `range`
// spreads less than `second` itself. Where it spreads more, the cloud was not seen from there.
double beam_width(std::span<const BeamSample> samples);

}  // namespace pointfair
