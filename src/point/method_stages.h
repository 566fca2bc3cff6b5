// SPDX-License-Identifier: Apache-2.0
// The bodies of the methods other than the bilateral one (docs/methods.md), in two rounds over the neighbours: the
// displacement of each point, then what the displacements of its neighbours change in it. Built as src/point/stages.h.
#pragma once

#include "point/method.h"
#include "point/stages.h"

namespace pointfair::point {

// What the methods read of the point itself.
template <class F>
struct OwnPlane {
  Vec3<F> normal;
  F area;  // weight
};

// The weighted mean of the neighbours' offsets.
template <class Neighbors, class Weights, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> mean_offset(const Neighbors& neighbors, Weights weights,
                                                              const Scalars& areas) {
  using F = NumberOf<Neighbors>;
  NeighborMean<F> sum;
  neighbors([&](auto there) { return areas.of(there); },
            [&](Vec3<F> offset, F area, auto inside) { sum.add(offset, offset, area, inside, weights); });
  return sum.mean();
}

template <class Neighbors, class Weights, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> to_quadric(const Neighbors& neighbors, Weights weights,
                                                             OwnPlane<NumberOf<Neighbors>> own, const Scalars& areas) {
  using F = NumberOf<Neighbors>;
  const F mean_height = dot(own.normal, mean_offset(neighbors, weights, areas));
  QuadricFit<F> fit(own.normal, mean_height, own.area, weights);
  neighbors([&](auto there) { return areas.of(there); },
            [&](Vec3<F> offset, F area, auto inside) { fit.add(offset, area, inside, weights); });
  return fit.height() * own.normal;
}

template <class Neighbors, class Weights, class Vectors, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> to_planes(const Neighbors& neighbors, Weights weights,
                                                            const Vectors& normals, const Scalars& areas) {
  using F = NumberOf<Neighbors>;
  PredictorMean<F> sum;
  neighbors(
      [&](auto there) {
        return WithArea<F>{normals.at(there), areas.of(there)};
      },
      [&](Vec3<F> offset, const WithArea<F>& there, auto inside) {
        sum.add(offset, there.vector, there.area, inside, weights);
      });
  return sum.mean();
}

// The displacement of the first round. `kTo` is rule.displacement.
template <Displacement kTo, class Neighbors, class Vectors, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> displacement_of(const Neighbors& neighbors, const MethodRule& rule,
                                                                  OwnPlane<NumberOf<Neighbors>> own,
                                                                  const Vectors& normals, const Scalars& areas) {
  using F = NumberOf<Neighbors>;
  const auto weights = weights_of(rule, neighbors.squared_radius());
  Vec3<F> d;
  if constexpr (kTo == Displacement::to_quadric) {
    d = to_quadric(neighbors, weights, own, areas);
  } else if constexpr (kTo == Displacement::to_planes) {
    d = to_planes(neighbors, weights, normals, areas);
  } else {
    d = mean_offset(neighbors, weights, areas);
    if constexpr (kTo == Displacement::to_plane) d = dot(own.normal, d) * own.normal;
  }
  return F(rule.strength) * d;
}

template <class Neighbors, class Weights, class Vectors, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> relaxed(const Neighbors& neighbors, Weights weights,
                                                          Relaxation relaxation, Vec3<NumberOf<Neighbors>> own,
                                                          const Vectors& displacements, const Scalars& areas) {
  using F = NumberOf<Neighbors>;
  NeighborMean<F> sum;
  neighbors(
      [&](auto there) {
        return WithArea<F>{displacements.at(there), areas.of(there)};
      },
      [&](Vec3<F> offset, const WithArea<F>& there, auto inside) {
        sum.add(there.vector, offset, there.area, inside, weights);
      });
  return F(relaxation.own) * own + F(relaxation.mean) * sum.mean();
}

template <class Neighbors, class Weights, class Vectors, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> shrunk(const Neighbors& neighbors, Weights weights,
                                                         const MethodRule& rule, Vec3<NumberOf<Neighbors>> own,
                                                         NumberOf<Neighbors> own_area, const Vectors& displacements,
                                                         const Scalars& areas) {
  using F = NumberOf<Neighbors>;
  WienerShrinkage<F> sum(own, own_area, weights);
  neighbors(
      [&](auto there) {
        return WithArea<F>{displacements.at(there), areas.of(there)};
      },
      [&](Vec3<F> offset, const WithArea<F>& there, auto inside) {
        sum.add(there.vector, offset, there.area, inside, weights);
      });
  return (F(rule.relaxation.own) * sum.share(rule.settings.similarity_sigma * rule.settings.similarity_sigma)) * own;
}

// The second round: what remains of the point's displacement `own`. `kBy` is rule.adjustment, and not none.
template <Adjustment kBy, class Neighbors, class Vectors, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> adjusted(const Neighbors& neighbors, const MethodRule& rule,
                                                           Vec3<NumberOf<Neighbors>> own, NumberOf<Neighbors> own_area,
                                                           const Vectors& displacements, const Scalars& areas) {
  const auto weights = weights_of(rule, neighbors.squared_radius());
  if constexpr (kBy == Adjustment::relaxation)
    return relaxed(neighbors, weights, rule.relaxation, own, displacements, areas);
  return shrunk(neighbors, weights, rule, own, own_area, displacements, areas);
}

}  // namespace pointfair::point
