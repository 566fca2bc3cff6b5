// SPDX-License-Identifier: Apache-2.0
// Where the sensor stood that saw a point, and what follows from it (docs/how-it-works.md, "Where the sensor stood").
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// One place for all points, or one for each. A place that is not finite is unknown.
struct Sensors {
  Vec3<float> place;
  const float* each;  // x, y, z of each point in upload order; null: `place` is that of all
};

// Beyond this angle between ray and normal, of which this is the cosine, a move along the ray fades, since it hardly
// changes the height over the surface.
inline constexpr float kGrazing = 0.25f;
// By how much a move along the ray may be longer than the one along the normal: 1 / kGrazing.
inline constexpr float kMostStretch = 4.0f;

// What `displacement` along a normal n becomes on the way `to_sensor`, r |r|: d / (n.r) along r, which ends on the same
// plane. Where |n.r| < kGrazing it is d (n.r) / kGrazing^2, so that it is continuous and vanishes where the ray lies in
// the plane. The displacement itself where the sensor's place is unknown or the point's own.
template <class F>
POINTFAIR_INLINE Vec3<F> along_ray(Vec3<F> displacement, Vec3<F> to_sensor) {
  const F squared = squared_length(displacement), squared_range = squared_length(to_sensor);
  const F common = dot(displacement, to_sensor);
  const auto grazes = common * common < (squared * squared_range) * (kGrazing * kGrazing);
  const F faded = common / (squared_range * (kGrazing * kGrazing)), whole = squared / common;
  const auto is_known = (squared_range > F{}) & (squared_range < F(3e38f));
  const F share = select(squared > F{}, select(grazes, faded, whole), F{});
  return select<F>(is_known, share * to_sensor, displacement);
}

// The squared distances to the two nearest neighbours of a point.
template <class F>
struct TwoNearest {
  F nearest, second;

  // `squared_reach`: of the neighbourhood, beyond which nothing is seen
  explicit POINTFAIR_INLINE TwoNearest(F squared_reach) : nearest(squared_reach), second(squared_reach) {}
  template <class Mask>
  POINTFAIR_INLINE void add(Vec3<F> offset, Mask inside) {
    const F squared = select(inside, squared_length(offset), second);
    second = smaller(second, larger(nearest, squared));
    nearest = smaller(nearest, squared);
  }
};

// Rays of a scan turn by equal steps, so a surface through a point has two neighbours of it near one step times the
// range away, where the range does not change, however steep the surface is to the ray. Noise adds to that: up to
// three standard deviations, half of the outlier distance. A point that lacks them lies between two surfaces.
template <class F>
POINTFAIR_INLINE auto is_mixed_pixel(const TwoNearest<F>& nearest, Vec3<F> to_sensor, float squared_beam_reach,
                                     F squared_outlier_distance) {
  return nearest.second > squared_length(to_sensor) * squared_beam_reach + squared_outlier_distance * 0.25f;
}

}  // namespace pointfair::point
