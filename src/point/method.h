// SPDX-License-Identifier: Apache-2.0
// What the methods other than the bilateral one are made of: a displacement of each point, and what the displacements
// of its neighbours change in it.
#pragma once

#include "point/fairing.h"
#include "point/laplacian.h"
#include "point/mls.h"
#include "point/mollified.h"
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
  Displacement displacement;
  Adjustment adjustment;
  BilateralWeights weights;
  bool of_radius;         // the closeness sigma is a multiple of the radius of the point's neighbourhood
  float strength;         // factor of the displacement before the adjustment
  Relaxation relaxation;  // `own` also of Adjustment::wiener
  float noise_variance;   // of Adjustment::wiener
  bool along_ray;         // points move along the ray; only where displacements are along the normal
};

// The weights of one point, whose neighbourhood has that radius.
template <class F>
POINTFAIR_INLINE LocalBilateralWeights<F, Gaussian> weights_of(const MethodRule& rule, F squared_radius) {
  const F closeness = F(rule.weights.inverse_two_closeness2);
  return {rule.of_radius ? closeness / squared_radius : closeness, F(rule.weights.inverse_two_similarity2)};
}

}  // namespace pointfair::point
