// SPDX-License-Identifier: Apache-2.0
// The Gaussian-weighted normal of one point: paper eq. 3-5, Eq. 3-5 of docs/how-it-works.md.
// Two rounds over the neighbours, in neighbour order: first their weighted centroid, then the covariance about it.
// Offsets are v_j - v_i, so nothing large is ever subtracted from something large. `inside` is false for an empty place
// of a list, which then adds exact zeros.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// `inverse` values are 0 for equal weights (Hoppe), since gaussian(0) is 1.
struct NormalWeights {
  float inverse_two_sigma2;  // 1 / (2 sigma^2), for w_g
  float inverse_sigma2;      // 1 / sigma^2, for the square of w_g in eq. 3
};

POINTFAIR_INLINE NormalWeights normal_weights(bool weighted, float sigma) {
  if (!weighted) return {0.0f, 0.0f};
  const float sigma2 = sigma * sigma;
  return {0.5f / sigma2, 1.0f / sigma2};
}

// Paper eq. 4, normalised.
template <class F>
struct CentroidSum {
  F weight{};
  Vec3<F> moment{};

  template <class Mask>
  POINTFAIR_INLINE void add(Vec3<F> offset, Mask inside, NormalWeights weights) {
    const F w = select(inside, gaussian(squared_length(offset) * weights.inverse_two_sigma2), F{});
    weight = weight + w;
    moment = moment + w * select<F>(inside, offset, Vec3<F>{});
  }
  POINTFAIR_INLINE Vec3<F> centroid() const {
    const F inverse = select(weight > F{}, F(1.0f) / weight, F{});
    return inverse * moment;
  }
};

// Paper eq. 3: the weight appears twice, so squared.
template <class F>
struct CovarianceSum {
  Sym3<F> sum{};

  template <class Mask>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> centroid, Mask inside, NormalWeights weights) {
    const Vec3<F> d = select<F>(inside, offset - centroid, Vec3<F>{});
    const F w2 = select(inside, gaussian(squared_length(d) * weights.inverse_sigma2), F{});
    const Vec3<F> wd = w2 * d;
    sum.xx = sum.xx + wd.x * d.x;
    sum.xy = sum.xy + wd.x * d.y;
    sum.xz = sum.xz + wd.x * d.z;
    sum.yy = sum.yy + wd.y * d.y;
    sum.yz = sum.yz + wd.y * d.z;
    sum.zz = sum.zz + wd.z * d.z;
  }
  POINTFAIR_INLINE Direction<F> normal() const { return least_eigenvector(sum); }
};

}  // namespace pointfair::point
