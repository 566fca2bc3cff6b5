// SPDX-License-Identifier: Apache-2.0
// Brute force as in Liang and others 2009 (CUKNN): one kernel writes all distances, a thread a pair of query and point;
// in a second one the threads of a block share a query, each finds the k nearest of its share of the points, and one
// thread merges these queues. The matrix of all distances fits into no card, so queries take turns.
#pragma once

#include <algorithm>

#include "paper/nearest.cuh"

namespace paper {

inline constexpr int kSharers = 128;                                 // threads of a query, and of a block
inline constexpr std::size_t kMostDistances = std::size_t(1) << 31;  // at a time, 8 GiB: enough blocks for a card
inline constexpr std::size_t kMostQueries = 65535;                   // at a time: the second size of a CUDA grid

// `memory`: of the card, bytes; an eighth of it holds the matrix.
inline std::size_t queries_at_a_time(std::size_t count, std::size_t memory) {
  const std::size_t distances = std::min(kMostDistances, memory / 8 / sizeof(float));
  return std::clamp(distances / count, std::size_t(1), std::min(count, kMostQueries));
}

// distances[row * count + point], of the query first + row: neighbouring threads write side by side
__global__ void __launch_bounds__(kSharers)
    compute_distances(const float3* points, std::size_t count, std::size_t first, float* distances) {
  const std::size_t at = std::size_t(blockIdx.x) * kSharers + threadIdx.x;
  if (at >= count) return;
  const float3 p = points[at], q = points[first + blockIdx.y];
  distances[blockIdx.y * count + at] = pointfair::point::squared_length(Vec{p.x - q.x, p.y - q.y, p.z - q.z});
}

template <int kLength>
__global__ void __launch_bounds__(kSharers)
    select_nearest(const float3* points, std::size_t count, std::size_t first, const float* distances, Index* lists) {
  __shared__ unsigned long long queues[kLength][kSharers];
  __shared__ int heads[kSharers];
  const std::size_t query = first + blockIdx.x;
  const float* const row = distances + blockIdx.x * count;
  Nearest<kLength> nearest(points);
  for (std::size_t at = threadIdx.x; at < count; at += kSharers) {
    const float distance = row[at];
    const bool nearer = !nearest.full() || distance <= nearest.worst();
    if (nearer && at != query) nearest.offer(pointfair::point::neighbor_key(distance, static_cast<Index>(at)));
  }
#pragma unroll
  for (int slot = 0; slot < kLength; ++slot) queues[slot][threadIdx.x] = nearest.keys[slot];
  heads[threadIdx.x] = 0;
  __syncthreads();
  if (threadIdx.x != 0) return;
  for (int slot = 0; slot < kLength; ++slot) {
    int best = 0;
    unsigned long long key = ~0ull;
    for (int sharer = 0; sharer < kSharers; ++sharer) {
      if (heads[sharer] == kLength) continue;
      const unsigned long long its = queues[heads[sharer]][sharer];
      if (its != ~0ull && (key == ~0ull || nearest.precedes(its, key))) best = sharer, key = its;
    }
    ++heads[best];
    lists[slot * count + query] = pointfair::point::key_index(key);
  }
}

}  // namespace paper
