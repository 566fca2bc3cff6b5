// SPDX-License-Identifier: Apache-2.0
// Brute force as in Garcia, Debreuve and Barlaud 2008, a thread a query. Their first kernel wrote the matrix of all
// distances and their second sorted its columns by insertion; here a distance is inserted as soon as it is computed,
// from points that a block reads together, which saves the matrix and is faster.
#pragma once

#include "paper/nearest.cuh"

namespace paper {

inline constexpr int kTile = 256;  // points in shared memory, and threads of a block

template <int kLength>
__global__ void __launch_bounds__(kTile) search_all_pairs(const float3* points, std::size_t count, Index* lists) {
  __shared__ float3 tile[kTile];
  const std::size_t query = std::size_t(blockIdx.x) * kTile + threadIdx.x;
  const float3 q = points[query < count ? query : 0];
  Nearest<kLength> nearest(points);
  for (std::size_t first = 0; first < count; first += kTile) {
    __syncthreads();
    if (first + threadIdx.x < count) tile[threadIdx.x] = points[first + threadIdx.x];
    __syncthreads();
    const int held = static_cast<int>(min(std::size_t(kTile), count - first));
    for (int i = 0; i < held; ++i) {
      const float3 p = tile[i];
      const float distance = pointfair::point::squared_length(Vec{p.x - q.x, p.y - q.y, p.z - q.z});
      const bool nearer = !nearest.full() || distance <= nearest.worst();
      if (nearer && first + i != query)
        nearest.offer(pointfair::point::neighbor_key(distance, static_cast<Index>(first + i)));
    }
  }
  if (query < count) nearest.store(lists, count, query);
}

}  // namespace paper
