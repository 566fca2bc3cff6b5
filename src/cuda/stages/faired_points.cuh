// SPDX-License-Identifier: Apache-2.0
// What the kernels of list_stages.cu, wide_stages.cu and methods.cu have in common: counting points without a normal,
// and writing moved points.
#pragma once

#include "cuda/stages/list_stages.cuh"
#include "point/stages.h"

namespace pointfair::cuda {

// All lanes of the warp take part; valid ones are counted.
__device__ __forceinline__ void count_unmoved(CloudState* state, bool valid,
                                              const point::NormalOfPoint<float, int>& normal) {
  const bool too_few = valid && normal.found < point::kLeastNeighbors;
  const bool no_normal = valid && !too_few && !(point::squared_length(normal.unit) > 0);
  const unsigned few = __ballot_sync(kAllLanes, too_few), none = __ballot_sync(kAllLanes, no_normal);
  if (lane_number() != 0) return;
  if (few != 0) atomicAdd(&state->too_few_neighbors, static_cast<unsigned long long>(__popc(few)));
  if (none != 0) atomicAdd(&state->no_normal, static_cast<unsigned long long>(__popc(none)));
}

// The vector from a point to its sensor.
__device__ __forceinline__ Vec to_sensor(const point::Sensors& sensors, float4 p, bool valid) {
  if (sensors.each == nullptr || !valid) return sensors.place - position_of(p);
  const float* const its = sensors.each + 3 * std::size_t(original_of(p));
  return Vec{its[0], its[1], its[2]} - position_of(p);
}

// Writes the point of each lane to its place in `out`, and nothing where the place is kNoNeighbor; all lanes of the
// warp take part. Three lanes write the three words of a point, so the cache meets one write a point and not three.
__device__ __forceinline__ void scatter(Point* out, Index to, Vec p) {
  float* words = &out->x;
#pragma unroll
  for (unsigned first = 0; first < 3 * kWarp; first += kWarp) {
    const unsigned word = first + lane_number(), lane = word / 3, axis = word % 3;
    const float x = __shfl_sync(kAllLanes, p.x, lane), y = __shfl_sync(kAllLanes, p.y, lane),
                z = __shfl_sync(kAllLanes, p.z, lane);
    const Index place = __shfl_sync(kAllLanes, to, lane);
    if (place != point::kNoNeighbor) words[std::size_t(place) * 3 + axis] = axis == 0 ? x : axis == 1 ? y : z;
  }
}

// All lanes of the warp take part.
__device__ __forceinline__ void store_faired(const FairedPoints& faired, std::size_t at, float4 p, bool valid,
                                             Vec moved) {
  const Index original = original_of(p);
  const bool exists = original != point::kNoNeighbor, staged = faired.staged != nullptr;
  if (exists && !valid) {
    const Point same = faired.input[original];
    moved = {same.x, same.y, same.z};
  }
  scatter(faired.in_order, staged && exists ? static_cast<Index>(at) : original, moved);
  if (staged && exists) faired.originals[at] = original;
}

}  // namespace pointfair::cuda
