// SPDX-License-Identifier: Apache-2.0
// The methods other than the bilateral one over the points of a leaf, in two rounds over the neighbours: every point's
// displacement, then what those of its neighbours change in it. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/stage_loops.h"

namespace pointfair::cpu::POINTFAIR_ISA {

using LocalWeights = point::LocalBilateralWeights<Floats>;

// What belongs to the points of the pack themselves.
struct Own {
  Index start;
  POINTFAIR_INLINE Floats of(const float* values) const { return load(values + start); }
};

// The weighted mean of the neighbours' offsets.
template <class Neighbors>
POINTFAIR_INLINE point::Vec3<Floats> mean_offset(const Neighbors& neighbors, LocalWeights weights, AreaView area) {
  point::NeighborMean<Floats> sum;
  neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
    sum.add(offset, offset, area_weight(area, there), inside, weights);
  });
  return sum.mean();
}

template <class Neighbors>
inline point::Vec3<Floats> to_quadric(const Neighbors& neighbors, LocalWeights weights, Index start,
                                      point::Vec3<Floats> normal, AreaView area) {
  const Floats mean_height = dot(normal, mean_offset(neighbors, weights, area));
  point::QuadricFit<Floats> fit(normal, mean_height, area_weight(area, Own{start}), weights);
  neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
    fit.add(offset, area_weight(area, there), inside, weights);
  });
  return fit.height() * normal;
}

template <class Neighbors>
inline point::Vec3<Floats> to_planes(const Neighbors& neighbors, LocalWeights weights, VectorsView normals,
                                     AreaView area) {
  point::PredictorMean<Floats> sum;
  neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
    sum.add(offset, vector_of(there, normals), area_weight(area, there), inside, weights);
  });
  return sum.mean();
}

template <class Neighbors>
POINTFAIR_INLINE point::Vec3<Floats> displacement_of_pack(const Neighbors& neighbors, Index start,
                                                          const point::MethodRule& rule, VectorsView normals,
                                                          AreaView area) {
  const LocalWeights weights = point::weights_of(rule, neighbors.squared_radius());
  const point::Vec3<Floats> normal = load_vector(normals.x, normals.y, normals.z, start);
  switch (rule.displacement) {
    case point::Displacement::to_quadric:
      return to_quadric(neighbors, weights, start, normal, area);
    case point::Displacement::to_planes:
      return to_planes(neighbors, weights, normals, area);
    case point::Displacement::to_plane:
      return dot(normal, mean_offset(neighbors, weights, area)) * normal;
    case point::Displacement::to_mean:
      break;
  }
  return mean_offset(neighbors, weights, area);
}

inline void displacements(const IndexView& index, Index leaf, Neighborhoods neighborhoods, VectorsView normals,
                          AreaView area, point::MethodRule rule, VectorsOut out) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    store_vector(out, start, Floats(rule.strength) * displacement_of_pack(neighbors, start, rule, normals, area));
  });
}

template <class Neighbors>
inline point::Vec3<Floats> relaxed(const Neighbors& neighbors, LocalWeights weights, point::Relaxation relaxation,
                                   point::Vec3<Floats> own, VectorsView displacements, AreaView area) {
  point::NeighborMean<Floats> sum;
  neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
    sum.add(vector_of(there, displacements), offset, area_weight(area, there), inside, weights);
  });
  return Floats(relaxation.own) * own + Floats(relaxation.mean) * sum.mean();
}

template <class Neighbors>
inline point::Vec3<Floats> shrunk(const Neighbors& neighbors, LocalWeights weights, const point::MethodRule& rule,
                                  Index start, point::Vec3<Floats> own, VectorsView displacements, AreaView area) {
  point::WienerShrinkage<Floats> sum(own, area_weight(area, Own{start}), weights);
  neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
    sum.add(vector_of(there, displacements), offset, area_weight(area, there), inside, weights);
  });
  return (Floats(rule.relaxation.own) * sum.share(rule.noise_variance)) * own;
}

// Moved positions, point after point into `xyz`.
inline void move(const IndexView& index, Index leaf, Neighborhoods neighborhoods, VectorsView displacements,
                 AreaView area, point::MethodRule rule, float* xyz) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const LocalWeights weights = point::weights_of(rule, neighbors.squared_radius());
    point::Vec3<Floats> d = load_vector(displacements.x, displacements.y, displacements.z, start);
    if (rule.adjustment == point::Adjustment::relaxation)
      d = relaxed(neighbors, weights, rule.relaxation, d, displacements, area);
    if (rule.adjustment == point::Adjustment::wiener)
      d = shrunk(neighbors, weights, rule, start, d, displacements, area);
    store_points(load_vector(index.x, index.y, index.z, start) + d, xyz + 3 * (start % kLeafSize));
  });
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
