// SPDX-License-Identifier: Apache-2.0
// Radius neighbourhoods, whose radii may differ from point to point, and how the bodies of the stages
// (src/point/stages.h) meet the neighbours of a point.
//
// `Neighbors` is a way to the neighbours of one point, or of each lane's point where several are treated at once:
//   using Number                the number type F of one such point or lanes
//   using Kernel                how a weight is made of an exponent (vec.h): Gaussian for lists, CompactGaussian within
//                               a radius
//   using Count                 a number of neighbours, to which counted(count, inside) adds one
//   kListed                     whether it is a list
//   neighbors(load, visit)      calls visit(offset, loaded, inside) for each neighbour, always in the same order.
//                               offset is v_j - v_i; `loaded` is what load(there) gave, at most 16 bytes, where `there`
//                               is the neighbour's handle, which the arrays of the same backend understand; where
//                               `inside` is false it is no neighbour of that lane, and its offset is some vector
//   neighbors.squared_radius()  of the neighbourhood; 1 for lists, which have no width of their own
//   neighbors.squared_core()    of 0.87 of that radius; infinite for lists
//   neighbors.squared_horizon() within it, all points are met: of the radius, 0 where neighbours are thinned, and for
//                               lists
//   neighbors.any(mask)         whether a mask holds in any lane that walks together with this one
#pragma once

#include "point/neighbors.h"
#include "point/vec.h"

namespace pointfair::point {

// R_i^2 = (L_i radius)^2 + (K_i r_i)^2, where L_i is the level of the noise at point i, r_i is the distance of point i
// to its `min_neighbors`-th nearest and K_i the level of that (node_field.h), which leaves the eighth nearest inside;
// the same radius for all if min_neighbors is 0. Neither K_i nor growth enlarge a radius beyond the widest.
struct Radii {
  const float* squared_radius;  // of each sorted point, or kNoSquaredRadius
  float squared_base;
  int min_neighbors;
  const float* squared_level = nullptr;   // L_i^2 of each sorted point; null: 1
  const float* squared_growth = nullptr;  // what multiplies R_i^2, of each sorted point; null: nothing
  float squared_widest = __builtin_inff();
};

inline constexpr int kLeastReached = 8;  // or min_neighbors, if that is less

// From the squared distances to the min_neighbors-th nearest and to the kLeastReached-th. Above squared_base where
// these are not zero, however small, so that kept_share() can tell. From a point far away all others are about as far
// as the nearest, so a radius any wider than that would hold them all: `squared_widest` bounds what the level adds.
template <class F>
POINTFAIR_INLINE F squared_radius(F squared_reach, F squared_least, F squared_reach_level, F squared_base,
                                  float squared_widest) {
  constexpr float kJustAbove = 1 + 0x1p-22f;
  const F reach = smaller(larger(squared_reach_level * squared_reach, squared_least),
                          larger(F(squared_widest), squared_reach)),
          all = reach + squared_base;
  return select(reach > F{}, larger(all, squared_base * kJustAbove), all);
}

// At level K_i of the reach, about kReachPoints K_i^2 points leave least error in a step. Where these are few,
// averaging once more harms the shape: the filter of the normals and every iteration after the first do so. A point
// takes part in those by a share that rises from 0 at kOncePoints to 1 at kFurtherPoints (Eq. 24 of
// docs/how-it-works.md).
inline constexpr float kReachPoints = 20, kOncePoints = kLeastReached, kFurtherPoints = 14;

POINTFAIR_INLINE float further_share(float squared_reach_level) {
  constexpr float kSlope = 1 / (kFurtherPoints - kOncePoints);
  return smaller(larger((kReachPoints * squared_reach_level - kOncePoints) * kSlope, 0.0f), 1.0f);
}

// What differs from place to place, of each sorted point; null: 1.
struct Levels {
  const float* squared_noise;
  const float* further_share;  // where it counts
};

// A neighbourhood that would hold many more points is thinned to about so many, by a hash of their positions, but to no
// smaller share of them than kLeastShare: where points are so dense, it holds fewer than a surface would.
inline constexpr float kNeighborhoodPoints = 400, kLeastShare = 1.0f / 1024;

// Points of which more than that are at one place have no neighbourhood and stay where they are: such a place is no
// measurement (many sensors write the origin for what they did not see), and a sum over it grows with its square.
inline constexpr float kNoSquaredRadius = -1;

// Whether more than kNeighborhoodPoints of the points from `begin` to `end` are at the place of sorted point `at`;
// is_same(i) says whether point i is. Points at one place follow each other along the curve.
template <class IsSame>
POINTFAIR_INLINE bool is_crowded(Index at, Index begin, Index end, const IsSame& is_same) {
  const auto most = [](Index room, const auto& is_same_at) {  // by bisection
    Index least = 0, beyond = (room < Index(kNeighborhoodPoints) ? room : Index(kNeighborhoodPoints)) + 1;
    while (beyond - least > 1) {
      const Index middle = least + (beyond - least) / 2;
      if (is_same_at(middle)) {
        least = middle;
      } else {
        beyond = middle;
      }
    }
    return least;
  };
  return most(at - begin, [&](Index n) { return is_same(at - n); }) +
             most(end - 1 - at, [&](Index n) { return is_same(at + n); }) >=
         Index(kNeighborhoodPoints);
}

// The share of its points that a neighbourhood of `squared_radius` keeps, where that of the point without growth is
// `own`: a surface holds min_neighbors R^2 / r^2 points. Above 1: all.
template <class F>
POINTFAIR_INLINE F kept_share(const Radii& radii, F squared_level, F own, F squared_radius) {
  const F squared_reach = own - squared_level * radii.squared_base;  // (K_i r_i)^2
  const F holds = select(squared_reach > F{}, squared_radius / squared_reach, F(1.0f));
  return larger(F(kNeighborhoodPoints / static_cast<float>(radii.min_neighbors)) / holds, F(kLeastShare));
}

// For visits that read nothing of a neighbour.
struct Nothing {};
struct LoadNothing {
  template <class There>
  POINTFAIR_DEVICE_INLINE Nothing operator()(There) const {
    return {};
  }
};

}  // namespace pointfair::point
