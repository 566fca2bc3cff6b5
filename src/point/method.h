// SPDX-License-Identifier: Apache-2.0
// What the methods other than the bilateral one are made of: a displacement of each point, and what the displacements
// of its neighbours change in it.
#pragma once

#include "point/fairing.h"
#include "point/laplacian.h"
#include "point/mls.h"
#include "point/mollified.h"
#include "point/settings.h"
#include "point/wiener.h"

namespace pointfair::point {

enum class Displacement : unsigned char {
  to_mean,     // of the neighbours
  to_plane,    // through their mean, along the point's normal
  to_quadric,  // along the point's normal
  to_planes,   // of the neighbours
};

enum class Adjustment : unsigned char { none, relaxation, wiener };

struct MethodRule {
  Displacement displacement = Displacement::to_mean;
  Adjustment adjustment = Adjustment::none;
  float strength = 1;                 // factor of the displacement before the adjustment
  Relaxation relaxation{1.0f, 0.0f};  // `own` also of Adjustment::wiener
  FairingSettings settings;           // its widths, and whether points move along the ray, which others do not read
};

// The weights of one point, whose neighbourhood has that radius.
template <class F>
POINTFAIR_INLINE LocalBilateralWeights<F, Gaussian> weights_of(const MethodRule& rule, F squared_radius) {
  const BilateralWeights weights = bilateral_weights(rule.settings.closeness_sigma, rule.settings.similarity_sigma);
  const F closeness = F(weights.inverse_two_closeness2);
  return {rule.settings.closeness_of_radius ? closeness / squared_radius : closeness,
          F(weights.inverse_two_similarity2)};
}

}  // namespace pointfair::point
