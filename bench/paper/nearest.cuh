// SPDX-License-Identifier: Apache-2.0
// The k nearest candidates of one thread, in the order of pointfair's lists, in registers.
#pragma once

#include "point/neighbors.h"

namespace paper {

using Vec = pointfair::point::Vec3<float>;
using pointfair::point::Index;

template <int kLength>
struct Nearest {
  const float3* points;
  unsigned long long keys[kLength];  // pointfair::point::neighbor_key

  __device__ explicit Nearest(const float3* positions) : points(positions) {
#pragma unroll
    for (int i = 0; i < kLength; ++i) keys[i] = ~0ull;
  }
  __device__ bool full() const { return keys[kLength - 1] != ~0ull; }
  __device__ float worst() const { return pointfair::point::key_squared_distance(keys[kLength - 1]); }

  __device__ bool precedes(unsigned long long a, unsigned long long b) const {
    return pointfair::point::precedes(a, b, [this](Index at) {
      const float3 p = points[at];
      return Vec{p.x, p.y, p.z};
    });
  }
  __device__ void offer(unsigned long long key) {
    if (!precedes(key, keys[kLength - 1])) return;
    bool before = true;
#pragma unroll
    for (int i = kLength - 1; i > 0; --i) {
      const bool before_previous = precedes(key, keys[i - 1]);
      keys[i] = before_previous ? keys[i - 1] : before ? key : keys[i];
      before = before_previous;
    }
    keys[0] = before ? key : keys[0];
  }
  // lists[slot * count + query]: neighbouring threads write side by side
  __device__ void store(Index* lists, std::size_t count, std::size_t query) const {
#pragma unroll
    for (int i = 0; i < kLength; ++i) lists[i * count + query] = pointfair::point::key_index(keys[i]);
  }
};

}  // namespace paper
