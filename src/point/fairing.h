// SPDX-License-Identifier: Apache-2.0
// The bilateral step of one point, in two forms: the paper's (eq. 1, 2 and 6; Eq. 1, 2 and 6 of docs/how-it-works.md),
// whose offsets are measured along the point's own normal, and the default's, which measures them against its own plane
// and its neighbours' planes alike (Eq. 10).
#pragma once

#include "point/normal.h"
#include "point/vec.h"

namespace pointfair::point {

struct BilateralWeights {
  using Kernel = Gaussian;
  float inverse_two_closeness2;   // 1 / (2 sigma_c^2)
  float inverse_two_similarity2;  // 1 / (2 sigma_s^2)
};

POINTFAIR_INLINE BilateralWeights bilateral_weights(float closeness_sigma, float similarity_sigma) {
  return {0.5f / (closeness_sigma * closeness_sigma), 0.5f / (similarity_sigma * similarity_sigma)};
}

// BilateralWeights that may differ from point to point.
template <class F, class Its>
struct LocalBilateralWeights {
  using Kernel = Its;
  F inverse_two_closeness2, inverse_two_similarity2;
};

// d_i of eq. 6. W_c W_s is one Gaussian of the summed exponents.
template <class F>
struct BilateralSum {
  F weight{};
  F moment{};

  // offset is v_j - v_i; area is W_a(v_j)
  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> normal, F area, Mask inside, Weights weights) {
    const F height = -dot(normal, offset);  // n_i . (v_i - v_j)
    const F exponent =
        squared_length(offset) * weights.inverse_two_closeness2 + (height * height) * weights.inverse_two_similarity2;
    add_weighted(Weights::Kernel::of(exponent), height, area, inside, weights);
  }
  // 0 where all weights vanish: the point then keeps its place
  POINTFAIR_INLINE F distance() const { return select(weight > F{}, moment / weight, F{}); }

 protected:
  template <class Mask, class Weights>
  POINTFAIR_INLINE void add_weighted(F closeness, F height, F area, Mask inside, Weights weights) {
    // the factor cancels in the quotient; without it a squared length of an area could overflow
    const F w = select(inside, closeness * (area * weights.inverse_two_closeness2), F{});
    weight = weight + w;
    moment = moment + w * height;
  }
};

// d_i of Eq. 10: the mean of the heights above the point's own plane and above the neighbour's, similarity measured
// against the neighbour's plane, and less weight where the normals differ.
template <class F>
struct SymmetricSum : BilateralSum<F> {
  // there is n_j, of any sign; zero if the neighbour has no normal
  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> normal, Vec3<F> there, F area, Mask inside, Weights weights,
                            float inverse_turn) {
    const F cosine = dot(normal, there);
    const F own = -dot(normal, offset), along = dot(there, offset);
    const F theirs = select(cosine < F{}, along, -along);  // of the two opposites, the normal that faces as this one
    const F exponent = (squared_length(offset) * weights.inverse_two_closeness2 +
                        (theirs * theirs) * weights.inverse_two_similarity2) +
                       turn_exponent(cosine, inverse_turn);
    this->add_weighted(Weights::Kernel::of(exponent), (own + theirs) * 0.5f, area, inside, weights);
  }
};

// Eq. 1: v_i' = v_i - n_i d_i.
template <class F>
POINTFAIR_INLINE Vec3<F> moved(Vec3<F> position, Vec3<F> normal, F distance) {
  return position - distance * normal;
}

}  // namespace pointfair::point
