// SPDX-License-Identifier: Apache-2.0
// Weighted means over a neighbourhood, Eq. 11 of docs/methods.md, and the displacements of the methods that need
// no more than means: Laplacian fairing, Taubin's lambda|mu and the HC algorithm (Eq. 12 to 14).
#pragma once

#include "point/weighted_mean.h"

namespace pointfair::point {

// The mean of one vector of each neighbour, weighted by W_c W_a. Of the neighbours' offsets it is the umbrella vector
// L(v_i); of their displacements it is what they move by around the point.
template <class F>
struct NeighborMean : WeightedMean<F> {
  // `vector` belongs to the neighbour at `offset` = v_j - v_i; area is W_a(v_j)
  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> vector, Vec3<F> offset, F area, Mask inside, Weights weights) {
    // the factor cancels in the quotient; without it a squared length of an area could overflow
    const F scale = area * weights.inverse_two_closeness2;
    const F w = gaussian(squared_length(offset) * weights.inverse_two_closeness2) * scale;
    this->add_weighted(select(inside, w, F{}), vector, inside);
  }
};

// What becomes of the displacement d_i once those of the neighbours are known: `own` d_i + `mean` of theirs (Eq. 13).
struct Relaxation {
  float own, mean;
};

inline constexpr float kPassBand = 0.1f;  // Taubin's k_PB: frequencies below it grow a little, all above fall

// Taubin 1995: lambda L, then mu L with 1 / lambda + 1 / mu = k_PB, both with the first weights, as one relaxation of
// d = lambda L (Eq. 13).
POINTFAIR_INLINE Relaxation taubin_relaxation(float lambda) {
  const float mu = 1.0f / (kPassBand - 1.0f / lambda);
  return {1.0f + mu / lambda - mu, mu};
}

inline constexpr float kPushBack = 0.5f;  // beta of the HC algorithm

// Vollmer, Mencl and Mueller 1999 with alpha = 0: of b_i, beta is taken back, and 1 - beta of the neighbours' mean b
// (Eq. 14).
POINTFAIR_INLINE Relaxation hc_relaxation() { return {1.0f - kPushBack, kPushBack - 1.0f}; }

}  // namespace pointfair::point
