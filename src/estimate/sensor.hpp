// SPDX-License-Identifier: Apache-2.0
// What distances between points tell of the sensor that saw them: its pattern of rays (point/sensor.h), and its place.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "estimate/nearest_rows.hpp"
#include "seam/sampling.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// What is known of the sensor, where a run reads it.
struct KnownSensor {
  std::shared_ptr<const SensorPlaces> places{};  // null: nothing
  double beam_width = 0;                         // of the pattern of rays, in radians; 0: not measured
};

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

// The one sensor that saw the cloud, by the same law: the place from which `second` over `range` spreads least. Nothing
// is known where that explains too little of how the distances spread, as where they do not differ, or where several
// sensors saw the cloud, or one that moved.
KnownSensor find_sensor(const NearestRows& nearest, const CloudSample& sample);

}  // namespace pointfair
