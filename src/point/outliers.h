// SPDX-License-Identifier: Apache-2.0
// Whether a point lies off the surface that its neighbours show, and what becomes of one that a run moved far
// (docs/how-it-works.md, "Outliers").
#pragma once

#include "point/normal.h"
#include "point/settings.h"
#include "point/vec.h"

namespace pointfair::point {

// Why a point is an outlier. Numbers are those of the NaN that takes the place of such a point between stages.
enum class Outlier : unsigned char {
  none,
  isolated,     // too few neighbours within reach
  off_surface,  // off the plane of its neighbours, or would move too far
  mixed_pixel,  // between two surfaces, as the sensor saw them
};
inline constexpr int kOutlierReasons = 3;
POINTFAIR_INLINE int place_among_reasons(Outlier outlier) { return static_cast<int>(outlier) - 1; }

POINTFAIR_INLINE float place_of(Outlier outlier) {
  union {
    unsigned u;
    float f;
  } bits = {0x7fc00000u + static_cast<unsigned>(outlier)};
  return bits.f;
}
// Of a place that is NaN.
POINTFAIR_INLINE Outlier outlier_at(float x) {
  union {
    float f;
    unsigned u;
  } bits = {x};
  const unsigned reason = bits.u & 3u;
  return reason == 0 ? Outlier::off_surface : static_cast<Outlier>(reason);
}

// A point is an outlier if fewer than a tenth of its neighbours lie within the outlier distance of its plane (two close
// sheets give each other half), or, in a neighbourhood of radius R, fewer than a twentieth within 0.87 R of it, where a
// surface through the point has three quarters of them (eight points lie all beyond by a chance of 1 to 65,000), or
// within the outlier distance if that is more: the tails of the noise are no outliers. Where R is larger than the
// outlier radius, points are so sparse that strays may be each other's neighbours: they fill the sphere, so seven
// tenths of them must lie near the plane. There, a surface that is as sparse bends by more than the outlier distance,
// so a slab of .15 R is near, of which strays have a quarter; and three tenths lie within 0.87 R, as what is far off
// has few beside it.
inline constexpr float kLeastNearPlane = 0.1f, kLeastOfSparse = 0.7f, kLeastNear = 0.05f, kNearSquaredRadius = 0.75f;
inline constexpr float kSparseSlab = 0.03f, kLeastNearOfSparse = 0.3f;  // of squared_core(); of the neighbours
// Of the neighbours of a point of one surface, so many lie near its plane.
inline constexpr float kPlane = 0.9f;

// Of 0.87 R.
template <class F>
POINTFAIR_INLINE F squared_core(F squared_radius) {
  return squared_radius * F(kNearSquaredRadius);
}

template <class F>
struct Agreement {
  F near_plane{}, near{}, all{};

  // `height`: over the point's plane; `squared_core`: of 0.87 R or the outlier distance, infinite where there is no
  // radius
  template <class Mask>
  POINTFAIR_INLINE void add(Vec3<F> offset, F height, Mask inside, F squared_distance, F squared_core) {
    const F one = select(inside, F(1.0f), F{});
    all = all + one;
    near_plane = near_plane + select(height * height <= squared_distance, one, F{});
    near = near + select(squared_length(offset) <= squared_core, one, F{});
  }
  template <class Mask>
  POINTFAIR_INLINE auto is_missing(Mask is_sparse) const {
    const F least = select(is_sparse, F(kLeastOfSparse), F(kLeastNearPlane));
    return (near_plane < all * least) | (near < all * select(is_sparse, F(kLeastNearOfSparse), F(kLeastNear)));
  }
  // Whether the neighbours show more than one surface, or none.
  POINTFAIR_INLINE auto lacks_plane() const { return near_plane < all * F(kPlane); }
  // Of those that are missing: whether they lack neighbours, and not a surface.
  template <class Mask>
  POINTFAIR_INLINE auto is_isolated(Mask is_sparse) const {
    return is_sparse | (near < all * F(kLeastNear));
  }
};

// Where an outlier is pulled to: a mean of its neighbours. In a list by closeness; within a radius by density, which
// the neighbours' own radii tell: strays are as near to each other as to the surface, but their radii are far wider.
template <class F>
struct PullSum {
  F weight{};
  Vec3<F> moment{};

  template <class Mask>
  POINTFAIR_INLINE void add_by_closeness(Vec3<F> offset, Mask inside, F inverse_two_sigma2) {
    add_weighted(gaussian(squared_length(offset) * inverse_two_sigma2), offset, inside);
  }
  // squared radii of the outlier's neighbourhood and of the neighbour's, which does not count if it has none
  template <class Mask>
  POINTFAIR_INLINE void add_by_density(Vec3<F> offset, Mask inside, F here, F there) {
    const F ratio = select(there < F{}, F{}, here / larger(there, F(1e-6f) * here));
    add_weighted(ratio * ratio * ratio, offset, inside);
  }
  // offset of the place; 0 where all weights vanish
  POINTFAIR_INLINE Vec3<F> mean() const {
    const F inverse = select(weight > F{}, F(1.0f) / weight, F{});
    return inverse * moment;
  }

 private:
  template <class Mask>
  POINTFAIR_INLINE void add_weighted(F closeness, Vec3<F> offset, Mask inside) {
    const F w = select(inside, closeness, F{});
    weight = weight + w;
    moment = moment + w * offset;
  }
};

struct Limited {
  Vec3<float> place;
  Outlier outlier;
};

// Where a point ends whose displacements lead from `before` to `after`, where the noise has that level. A way d up to
// the limit is made as it is. A longer one becomes limit^2 / d: noise does not go so far, but edges do that
// neighbourhoods reach across. A point whose way is longer than the outlier distance is an outlier and stays at
// `before`, and so is one whose neighbours did not agree with it (`after` is NaN then). There is a limit, and the
// outlier distance is no less.
POINTFAIR_INLINE Limited limited(Vec3<float> before, Vec3<float> after, const DisplacementLimits& limits, float level) {
  const float limit = limits.farthest_follows ? limits.farthest * level : limits.farthest;
  const float outlier_distance = larger(larger(limits.outlier_distance, limits.level_outlier_distance * level), limit);
  const Vec3<float> way = after - before;
  const float squared = squared_length(way);
  if (!(squared <= outlier_distance * outlier_distance))
    return {before, after.x != after.x ? outlier_at(after.x) : Outlier::off_surface};
  if (squared <= limit * limit) return {after, Outlier::none};
  return {before + (limit * limit / squared) * way, Outlier::none};
}

}  // namespace pointfair::point
