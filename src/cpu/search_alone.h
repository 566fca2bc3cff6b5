// SPDX-License-Identifier: Apache-2.0
// What the search of one place (src/cpu/single_search.h) asks of a node or a leaf: 16 numbers at once, and bits for
// those that are at most `limit`. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/pack.h"

namespace pointfair::cpu::POINTFAIR_ISA {

inline unsigned child_gaps(const BoxGroup& group, point::Vec3<float> place, float limit, float* gaps) {
  const point::Vec3<Floats> here = spread(place.x, place.y, place.z);
  unsigned near = 0;
  for (int c = 0; c < kLeafSize; c += kLanes) {
    const point::Vec3<Floats> min = {load(group.min_x + c), load(group.min_y + c), load(group.min_z + c)};
    const point::Vec3<Floats> max = {load(group.max_x + c), load(group.max_y + c), load(group.max_z + c)};
    const Floats gap = point::squared_gap(min, max, here, here);
    store(gaps + c, gap);
    near |= bits((gap <= broadcast(limit)) & (min.x <= max.x)) << c;
  }
  return near;
}

inline unsigned leaf_distances(const IndexView& index, Index leaf, point::Vec3<float> place, float limit,
                               float* squared) {
  const point::Vec3<Floats> here = spread(place.x, place.y, place.z);
  unsigned near = 0;
  for (int c = 0; c < kLeafSize; c += kLanes) {
    const Index first = leaf * kLeafSize + Index(c);
    const point::Vec3<Floats> there = {load(index.x + first), load(index.y + first), load(index.z + first)};
    const Floats distance = point::squared_length(there - here);
    store(squared + c, distance);
    near |= bits(distance <= broadcast(limit)) << c;
  }
  return near;
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
