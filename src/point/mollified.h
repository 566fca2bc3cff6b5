// SPDX-License-Identifier: Apache-2.0
// The step of one point by its neighbours' predictors, the projections onto their planes (Jones, Durand and Desbrun
// 2003), Eq. 17 of docs/methods.md.
#pragma once

#include "point/weighted_mean.h"

namespace pointfair::point {

template <class F>
struct PredictorMean : WeightedMean<F> {
  // there is n_j, of any sign; a neighbour without a normal predicts nothing
  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> there, F area, Mask inside, Weights weights) {
    const F height = dot(there, offset);
    const F exponent =
        squared_length(offset) * weights.inverse_two_closeness2 + (height * height) * weights.inverse_two_similarity2;
    const Mask predicts = inside & (squared_length(there) > F{});
    const F w = gaussian(exponent) * (area * weights.inverse_two_closeness2);
    this->add_weighted(select(predicts, w, F{}), height * there, inside);
  }
};

}  // namespace pointfair::point
