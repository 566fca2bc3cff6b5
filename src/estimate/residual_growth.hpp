// SPDX-License-Identifier: Apache-2.0
// What tells shape and correlated noise from noise: how residuals grow with the neighbourhood.
#pragma once

#include <span>

#include "point/sample.h"

namespace pointfair {

// How residuals grow from neighbourhoods of some points to those of twice as many: hardly where they are noise.
struct Growth {
  double flat = 1, typical = 1;  // of the 15 % quantiles and of the medians
  double first = 0, second = 0;  // of the mean variance in flat places, less one; from there to twice as many again

  // How much the second growth is of the first: of shape it is more. 0 where residuals do not grow twice.
  double slowing() const { return first > 0 && second > 0 ? second / first : 0; }
};

Growth residual_growth(std::span<const point::ResidualSample> samples);

// How far the noise is correlated between neighbouring points, 0 to 1.
double correlation(std::span<const point::ResidualSample> samples);

// Of the variances in neighbourhoods of 30 points at a typical place: as Noise::shape_to_noise.
double shape_to_noise(std::span<const point::ResidualSample> samples);

}  // namespace pointfair
