// SPDX-License-Identifier: Apache-2.0
// The stages of src/point/method_stages.h over the points of one leaf, a pack at a time. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/stage_loops.h"
#include "point/method_stages.h"

namespace pointfair::cpu::POINTFAIR_ISA {

template <point::Displacement kTo>
void displace_leaf(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods, VectorsView normals,
                   AreaView area, const point::MethodRule& rule, VectorsOut out) {
  const Vectors of_points{normals};
  const Areas areas{area};
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const point::OwnPlane<Floats> own{of_points.at(Own{start}), areas.of(Own{start})};
    store_vector(out, start, point::displacement_of<kTo>(neighbors, rule, own, of_points, areas));
  });
}

inline void displacements(const IndexView& index, Index leaf, Neighborhoods neighborhoods, VectorsView normals,
                          AreaView area, const point::MethodRule& rule, VectorsOut out) {
  using point::Displacement;
  const auto displace = rule.displacement == Displacement::to_quadric  ? displace_leaf<Displacement::to_quadric>
                        : rule.displacement == Displacement::to_planes ? displace_leaf<Displacement::to_planes>
                        : rule.displacement == Displacement::to_plane  ? displace_leaf<Displacement::to_plane>
                                                                       : displace_leaf<Displacement::to_mean>;
  displace(index, leaf, neighborhoods, normals, area, rule, out);
}

template <point::Adjustment kBy>
void move_leaf(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods, VectorsView displacements,
               AreaView area, const point::MethodRule& rule, const point::Sensors& sensors, float* xyz) {
  const Vectors of_points{displacements};
  const Areas areas{area};
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    point::Vec3<Floats> d = of_points.at(Own{start});
    if constexpr (kBy != point::Adjustment::none)
      d = point::adjusted<kBy>(neighbors, rule, d, areas.of(Own{start}), of_points, areas);
    const point::Vec3<Floats> here = load_vector(index.x, index.y, index.z, start);
    if (rule.settings.along_ray) d = point::along_ray(d, to_sensors(index, sensors, start, here));
    store_points(here + d, xyz + 3 * (start % kLeafSize));
  });
}

// Moved positions, point after point into `xyz`.
inline void move(const IndexView& index, Index leaf, Neighborhoods neighborhoods, VectorsView displacements,
                 AreaView area, const point::MethodRule& rule, point::Sensors sensors, float* xyz) {
  using point::Adjustment;
  const auto move_points = rule.adjustment == Adjustment::relaxation ? move_leaf<Adjustment::relaxation>
                           : rule.adjustment == Adjustment::wiener   ? move_leaf<Adjustment::wiener>
                                                                     : move_leaf<Adjustment::none>;
  move_points(index, leaf, neighborhoods, displacements, area, rule, sensors, xyz);
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
