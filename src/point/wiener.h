// SPDX-License-Identifier: Apache-2.0
// The local adaptive Wiener filter of one point's height above its neighbourhood's plane (Peng, Strela and Zorin 2001;
// Alexa 2002), Eq. 15 of docs/methods.md.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// The mean square of the heights around a point, its own among them. What exceeds the variance that noise explains is
// taken for shape, and that share of the height stays.
template <class F>
struct WienerShrinkage {
  F weight, moment;          // of W_c W_a, over the point and its neighbours
  F closeness{}, squares{};  // of W_c and its square, over the neighbours

  template <class Weights>
  POINTFAIR_INLINE WienerShrinkage(Vec3<F> displacement, F area, Weights weights)
      : weight(area * weights.inverse_two_closeness2), moment(weight * squared_length(displacement)) {}

  // `displacement` is the neighbour's, by its height along its normal
  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> displacement, Vec3<F> offset, F area, Mask inside, Weights weights) {
    const F g = select(inside, gaussian(squared_length(offset) * weights.inverse_two_closeness2), F{});
    const F w = g * (area * weights.inverse_two_closeness2);
    closeness = closeness + g;
    squares = squares + g * g;
    weight = weight + w;
    moment = moment + w * select(inside, squared_length(displacement), F{});
  }
  // The share of the height that is noise, in [0, 1]. A height carries the point's own noise and that of the mean.
  POINTFAIR_INLINE F share(float noise_variance) const {
    const F mean_noise = select(closeness > F{}, squares / (closeness * closeness), F{});
    const F noise = (mean_noise + 1.0f) * noise_variance;
    const F seen = select(weight > F{}, moment / weight, F{});
    return select(seen > noise, noise / seen, F(1.0f));
  }
};

}  // namespace pointfair::point
