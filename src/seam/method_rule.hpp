// SPDX-License-Identifier: Apache-2.0
// How each method but the bilateral one is put together from the formulas of src/point; the same for every backend.
#pragma once

#include "point/method.h"
#include "seam/settings.hpp"

namespace pointfair {

// settings.method is not Method::bilateral.
inline point::MethodRule method_rule(const FairingSettings& settings) {
  using point::Adjustment, point::Displacement;
  point::MethodRule rule{Displacement::to_mean,
                         Adjustment::none,
                         point::bilateral_weights(settings.closeness_sigma, settings.similarity_sigma),
                         settings.closeness_of_radius,
                         settings.strength,
                         {1.0f, 0.0f},
                         settings.similarity_sigma * settings.similarity_sigma};
  switch (settings.method) {
    case Method::bilateral:
    case Method::laplacian:
      break;
    case Method::taubin:
      rule.adjustment = Adjustment::relaxation;
      rule.relaxation = point::taubin_relaxation(settings.strength);
      break;
    case Method::hc_laplacian:
      rule.adjustment = Adjustment::relaxation;
      rule.relaxation = point::hc_relaxation();
      break;
    case Method::mls:
      rule.displacement = Displacement::to_quadric;
      break;
    case Method::wiener:
      rule.displacement = Displacement::to_plane;
      rule.adjustment = Adjustment::wiener;
      rule.strength = 1.0f;  // whole heights tell shape from noise
      rule.relaxation.own = settings.strength;
      break;
    case Method::mollified:
      rule.displacement = Displacement::to_planes;
      break;
  }
  return rule;
}

}  // namespace pointfair
