// SPDX-License-Identifier: Apache-2.0
// Each lane's list of neighbours in registers, nearly in order, is put in the order of point::precedes: exchanges of
// those beside each other, over and over. kNoNeighbor stands for none, at the beginning or the end.
#pragma once

#include "cuda/index/tree.cuh"

namespace pointfair::cuda {

// One round by distance; returns whether any were exchanged, and if not whether any are equally far.
struct OrderRound {
  bool exchanged = false, tied = false;
};
template <int kList>
__device__ __forceinline__ OrderRound order_by_distance(float (&distance)[kList], Index (&found)[kList]) {
  OrderRound round;
#pragma unroll
  for (int i = 0; i + 1 < kList; ++i) {
    const bool wrong = distance[i] > distance[i + 1];
    round.tied |= distance[i] == distance[i + 1];
    const float d = distance[i];
    const Index f = found[i];
    distance[i] = wrong ? distance[i + 1] : d;
    found[i] = wrong ? found[i + 1] : f;
    distance[i + 1] = wrong ? d : distance[i + 1];
    found[i + 1] = wrong ? f : found[i + 1];
    round.exchanged |= wrong;
  }
  return round;
}

// The same by position for those equally far, which follow each other.
template <int kList>
__device__ __forceinline__ bool order_ties(const float4* points, const float (&distance)[kList],
                                           Index (&found)[kList]) {
  bool exchanged = false;
#pragma unroll
  for (int i = 0; i + 1 < kList; ++i) {
    const bool tied =
        distance[i] == distance[i + 1] && found[i] != point::kNoNeighbor && found[i + 1] != point::kNoNeighbor;
    if (!tied || !lies_before(points, found[i + 1], found[i])) continue;
    const Index f = found[i];
    found[i] = found[i + 1];
    found[i + 1] = f;
    exchanged = true;
  }
  return exchanged;
}

// All lanes of the warp take part; only `wanted` lists need to be in order at the end. Positions are only read where
// distances are equal. Places that hold none should differ in distance, or they are looked at in vain.
template <int kList>
__device__ __forceinline__ void put_in_order(const float4* points, float (&distance)[kList], Index (&found)[kList],
                                             bool wanted) {
  OrderRound round;
  do {
    round = order_by_distance(distance, found);
  } while (__any_sync(kAllLanes, round.exchanged && wanted));
  if (!__any_sync(kAllLanes, round.tied && wanted)) return;
  while (__any_sync(kAllLanes, order_ties(points, distance, found) && wanted)) {
  }
}

}  // namespace pointfair::cuda
