// SPDX-License-Identifier: Apache-2.0
// Puts each lane's list of neighbours, which lies in registers nearly in order, into the order of point::precedes, by
// exchanges of neighbours beside each other, over and over. Ties are rare: they are put in order once the list is in
// memory, where that takes few instructions. kNoNeighbor stands for none, at the beginning or the end.
#pragma once

#include "cuda/index/tree.cuh"

namespace pointfair::cuda {

// One round by distance; returns whether any were exchanged.
template <int kList>
__device__ __forceinline__ bool exchange_neighbors(float (&distance)[kList], Index (&found)[kList]) {
  bool exchanged = false;
#pragma unroll
  for (int i = 0; i + 1 < kList; ++i) {
    const bool wrong = distance[i] > distance[i + 1];
    const float d = distance[i];
    const Index f = found[i];
    distance[i] = wrong ? distance[i + 1] : d;
    found[i] = wrong ? found[i + 1] : f;
    distance[i + 1] = wrong ? d : distance[i + 1];
    found[i + 1] = wrong ? f : found[i + 1];
    exchanged |= wrong;
  }
  return exchanged;
}

// By distance; returns whether any are equally far. All lanes of the warp take part; only `wanted` lists need to be in
// order at the end. Places that hold none must differ in distance or be infinitely far.
template <int kList>
__device__ __forceinline__ bool order_by_distance(float (&distance)[kList], Index (&found)[kList], bool wanted) {
  while (__any_sync(kAllLanes, exchange_neighbors(distance, found) && wanted)) {
  }
  bool tied = false;
#pragma unroll
  for (int i = 0; i + 1 < kList; ++i)
    tied |= distance[i] == distance[i + 1] && distance[i] < __int_as_float(0x7f800000);
  return tied;
}

// Puts those equally far from `query` in the order of their positions. The list has k places, kWarp apart, and is in
// order by distance.
__device__ __forceinline__ void order_ties(const float4* points, Vec query, int k, Index* list) {
  const auto distance_of = [&](Index at) { return point::squared_length(position_of(points[at]) - query); };
#pragma unroll 1
  for (int i = 1; i < k; ++i) {
    const Index at = list[i * kWarp];
    if (at == point::kNoNeighbor) return;
    const float distance = distance_of(at);
    int place = i;
#pragma unroll 1
    for (; place > 0; --place) {
      const Index before = list[(place - 1) * kWarp];
      if (distance_of(before) != distance || !lies_before(points, at, before)) break;
      list[place * kWarp] = before;
    }
    if (place < i) list[place * kWarp] = at;
  }
}

}  // namespace pointfair::cuda
