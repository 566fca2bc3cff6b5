// SPDX-License-Identifier: Apache-2.0
// The weighted bilateral step of one point: paper eq. 1, 2 and 6, Eq. 1, 2 and 6 of docs/how-it-works.md.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

struct BilateralWeights {
  float inverse_two_closeness2;   // 1 / (2 sigma_c^2)
  float inverse_two_similarity2;  // 1 / (2 sigma_s^2)
};

POINTFAIR_INLINE BilateralWeights bilateral_weights(float closeness_sigma, float similarity_sigma) {
  return {0.5f / (closeness_sigma * closeness_sigma), 0.5f / (similarity_sigma * similarity_sigma)};
}

// d_i of eq. 6. W_c W_s is one Gaussian of the summed exponents.
template <class F>
struct BilateralSum {
  F weight{};
  F moment{};

  // offset is v_j - v_i; area is W_a(v_j)
  template <class Mask>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> normal, F area, Mask inside, BilateralWeights weights) {
    const F height = -dot(normal, offset);  // n_i . (v_i - v_j)
    const F exponent =
        squared_length(offset) * weights.inverse_two_closeness2 + (height * height) * weights.inverse_two_similarity2;
    // the factor cancels in the quotient; without it a squared length of an area could overflow
    const F w = select(inside, gaussian(exponent) * (area * weights.inverse_two_closeness2), F{});
    weight = weight + w;
    moment = moment + w * select(inside, height, F{});
  }
  // 0 where all weights vanish: the point then keeps its place
  POINTFAIR_INLINE F distance() const { return select(weight > F{}, moment / weight, F{}); }
};

// Eq. 1: v_i' = v_i - n_i d_i.
template <class F>
POINTFAIR_INLINE Vec3<F> moved(Vec3<F> position, Vec3<F> normal, F distance) {
  return position - distance * normal;
}

}  // namespace pointfair::point
