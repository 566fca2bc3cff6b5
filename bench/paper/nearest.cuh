// SPDX-License-Identifier: Apache-2.0
// The k nearest candidates of one thread, sorted by distance, then by index, in registers.
#pragma once

#include "point/neighbors.h"

namespace paper {

using Vec = pointfair::point::Vec3<float>;
using pointfair::point::Index;

template <int kLength>
struct Nearest {
  unsigned long long keys[kLength];  // pointfair::point::neighbor_key

  __device__ Nearest() {
#pragma unroll
    for (int i = 0; i < kLength; ++i) keys[i] = ~0ull;
  }
  __device__ bool full() const { return keys[kLength - 1] != ~0ull; }
  __device__ float worst() const { return pointfair::point::key_squared_distance(keys[kLength - 1]); }

  __device__ void offer(unsigned long long key) {
    if (key >= keys[kLength - 1]) return;
#pragma unroll
    for (int i = kLength - 1; i >= 0; --i) {
      const unsigned long long before = i > 0 ? keys[i - 1] : 0;
      keys[i] = key < before ? before : key < keys[i] ? key : keys[i];
    }
  }
  // lists[slot * count + query]: neighbouring threads write side by side
  __device__ void store(Index* lists, std::size_t count, std::size_t query) const {
#pragma unroll
    for (int i = 0; i < kLength; ++i) lists[i * count + query] = pointfair::point::key_index(keys[i]);
  }
};

}  // namespace paper
