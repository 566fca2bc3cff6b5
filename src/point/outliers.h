// SPDX-License-Identifier: Apache-2.0
// Whether a point lies off the surface that its neighbours show, and what becomes of one that a run moved far
// (docs/how-it-works.md, "Outliers").
#pragma once

#include "point/normal.h"
#include "point/vec.h"

namespace pointfair::point {

// A point is an outlier if fewer than a tenth of its neighbours lie within the outlier distance of its plane (two close
// sheets give each other half), or, in a ball of radius R, fewer than a twentieth within 0.7 R of it, where a surface
// through the point has half of them, or within the outlier distance if that is more: the tails of the noise are no
// outliers. Where R is larger than the outlier radius, points are so sparse that strays may be each other's neighbours:
// they fill the ball, so seven tenths of them must lie near the plane.
inline constexpr float kLeastNearPlane = 0.1f, kLeastOfSparse = 0.7f, kLeastNear = 0.05f, kNearSquaredRadius = 0.49f;

// Of 0.7 R.
template <class F>
POINTFAIR_INLINE F squared_core(F squared_radius) {
  return squared_radius * F(kNearSquaredRadius);
}

template <class F>
struct Agreement {
  F near_plane{}, near{}, all{};

  // `squared_core`: of 0.7 R or the outlier distance, infinite where there is no radius
  template <class Mask>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> normal, Mask inside, float squared_distance, F squared_core) {
    const F height = dot(normal, offset), one = select(inside, F(1.0f), F{});
    all = all + one;
    near_plane = near_plane + select(height * height <= F(squared_distance), one, F{});
    near = near + select(squared_length(offset) <= squared_core, one, F{});
  }
  template <class Mask>
  POINTFAIR_INLINE auto is_missing(Mask is_sparse) const {
    const F least = select(is_sparse, F(kLeastOfSparse), F(kLeastNearPlane));
    return (near_plane < all * least) | (near < all * F(kLeastNear));
  }
};

// What the Gaussian-weighted mean of the neighbours, where an outlier is pulled to, reads of the weights.
template <class F>
struct PullWeights {
  F inverse_two_sigma2;
};

struct Settled {
  Vec3<float> place;
  bool is_outlier;
};

// A point moves no farther than `limit`, and what would move by more by the less the more it would be, limit^2 over
// that way: so far goes no noise, but edges that balls reach across. One that would move farther than
// `outlier_distance`, or whose neighbours did not agree with it (`after` is NaN then), is an outlier and stays at
// `before`. 0 < limit <= outlier_distance.
POINTFAIR_INLINE Settled settled(Vec3<float> before, Vec3<float> after, float limit, float outlier_distance) {
  const Vec3<float> step = after - before;
  const float squared = squared_length(step);
  if (!(squared <= outlier_distance * outlier_distance)) return {before, true};
  if (squared <= limit * limit) return {after, false};
  return {before + (limit * limit / squared) * step, false};
}

}  // namespace pointfair::point
