// SPDX-License-Identifier: Apache-2.0
// The weighted mean of a vector over the neighbours of one point.
#pragma once

#include "point/neighbors.h"
#include "point/vec.h"

namespace pointfair::point {

template <class F>
struct WeightedMean {
  F weight{}, count{};
  Vec3<F> moment{};

  // zero where there are fewer than kLeastNeighbors neighbours, or all weights vanish
  POINTFAIR_INLINE Vec3<F> mean() const {
    const auto known = (weight > F{}) & (F(static_cast<float>(kLeastNeighbors) - 0.5f) < count);
    const F inverse = select(known, F(1.0f) / weight, F{});
    return inverse * moment;
  }

 protected:
  // `w` must be 0 where `inside` is false
  template <class Mask>
  POINTFAIR_INLINE void add_weighted(F w, Vec3<F> vector, Mask inside) {
    weight = weight + w;
    count = count + select(inside, F(1.0f), F{});
    moment = moment + w * select<F>(inside, vector, Vec3<F>{});
  }
};

}  // namespace pointfair::point
