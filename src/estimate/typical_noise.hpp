// SPDX-License-Identifier: Apache-2.0
// The noise of a typical place, by what samples of the cloud show.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>

#include "estimate/estimate.hpp"
#include "point/sample.h"
#include "seam/sampling.hpp"

namespace pointfair {

// Of the neighbourhoods that are wide against the noise.
Noise noise_of(std::span<const point::NoiseSample> samples, bool depth_has_steps);

// Whether most samples that see a surface nearby are on tubes of few points, of which no surface shows. Along a thin
// line none does, and what wide neighbourhoods see there is several tubes.
bool are_tubes(std::span<const point::NoiseSample> samples, std::span<const point::ResidualSample> residuals);

// Whether most samples may see two sheets of thin parts, which are too near to each other to be told from one sheet at
// each of them. Noise that is even between two bounds looks so, too, but ends there. In a small cloud other parts are
// as near.
bool may_be_thin(Sampling& from, const Samples& samples, std::span<const std::uint32_t> queries,
                 const std::stop_token& stop);

// Adds what residuals of fewer points show, in a cloud of so many points.
void add_residuals(Noise& noise, std::span<const point::ResidualSample> samples, std::uint64_t points);

// The most that the noise may be where shape is at all places, as residuals that grow from few points to many show:
// what few points show at the flattest places (Eq. 25). Endless for other clouds. `spacing`: of the surface.
double most_noise(std::span<const point::ResidualSample> samples, double spacing);

}  // namespace pointfair
