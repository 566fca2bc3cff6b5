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

// Rays of a scan turn by equal steps, so one angle fits all surfaces that are not steep to the rays: the width of the
// pattern of beams, which is the typical angle from a point to its twelfth nearest neighbour. A point of a surface,
// however steep, has two neighbours within about that angle times its range, along a row of rays, and twelve within a
// few times that distance. Noise adds up to three standard deviations, half of the outlier distance. A point without
// two such neighbours lies alone between two surfaces. A point without the twelve lies in a veil or a row of such
// points. Only a steep surface has steps as wide as that, and then its points agree on a plane. Where they do not, the
// two must lie within the diagonal of a cell of the grid of rays, whose width is about two steps.
inline constexpr int kPatternNeighbors = 12;
inline constexpr float kWidthsToTwo = 1.1f, kWidthsToTwelve = 3.5f, kWidthsToDiagonal = 0.7f;

// Counts the neighbours of one point within each of these distances.
template <class F>
struct BeamNeighbors {
  F squared_reach_of_two, squared_reach_of_twelve, squared_diagonal;
  F near{}, far{}, within_diagonal{}, squared_farthest{};

  // `squared_width`: the squared angle
  POINTFAIR_INLINE BeamNeighbors(Vec3<F> to_sensor, float squared_width, F squared_outlier_distance) {
    const F squared = squared_length(to_sensor) * F(squared_width), of_noise = squared_outlier_distance * F(0.25f);
    squared_reach_of_two = squared * F(kWidthsToTwo * kWidthsToTwo) + of_noise;
    squared_reach_of_twelve = squared * F(kWidthsToTwelve * kWidthsToTwelve) + of_noise;
    squared_diagonal = squared * F(kWidthsToDiagonal * kWidthsToDiagonal) + of_noise;
  }
  template <class Mask>
  POINTFAIR_INLINE void add(Vec3<F> offset, Mask inside) {
    const F squared = squared_length(offset), one = select(inside, F(1.0f), F{});
    near = near + select(squared <= squared_reach_of_two, one, F{});
    far = far + select(squared <= squared_reach_of_twelve, one, F{});
    within_diagonal = within_diagonal + select(squared <= squared_diagonal, one, F{});
    squared_farthest = larger(squared_farthest, select(inside, squared, F{}));
  }
  // `squared_horizon`: within it, all neighbours were added. `lacks_plane`: they agree on none.
  template <class Mask>
  POINTFAIR_INLINE auto is_mixed_pixel(F squared_horizon, Mask lacks_plane) const {
    return ((near < F(2.0f)) & (squared_reach_of_two <= squared_horizon)) |
           ((within_diagonal < F(2.0f)) & (squared_diagonal <= squared_horizon) & lacks_plane) |
           ((far < F(float(kPatternNeighbors))) & (squared_reach_of_twelve <= squared_horizon));
  }
};

}  // namespace pointfair::point
