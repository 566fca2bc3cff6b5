// SPDX-License-Identifier: Apache-2.0
// What the net of src/point/net.h reads and writes of each sorted point on the card, and how it reads neighbours.
#pragma once

#include "cuda/search/lists.cuh"
#include "point/net.h"

namespace pointfair::cuda {

namespace net = point::net;

// Rows for whole leaves, in words of 16 bytes where neighbours are read. Of places without a point the numbers mean
// nothing, and no list names them.
struct NetCloud {
  Index places;
  float4* classical;       // and the noise; from slide_apart() on where the point slid
  float4* normal;          // and x of the measured position; from the first state on on the side of the neighbours
  const float2* measured;  // y and z
  Vec* side;
  Vec* step;  // from where the default run put the point, in noises
  float* size[net::kScales];
  net::Scale* scale[net::kScales];  // until the first state is made; all but the finest of a part of the cloud
  const unsigned* state;            // kChannelWords of each
  unsigned* next;                   // the same, of the next layer

  __device__ __forceinline__ net::Place place(std::size_t at) const {
    const float4 a = classical[at], b = normal[at];
    const float2 c = measured[at];
    return {{a.x, a.y, a.z}, {b.x, b.y, b.z}, {b.w, c.x, c.y}, a.w};
  }
  __device__ __forceinline__ net::Neighbor<float> neighbor(Index at) const {
    const net::Place p = place(at);
    return {p.classical, p.normal, p.measured, p.noise};
  }
  // The neighbour of a number; of places without a point, themselves. Lists are as those of lists.cuh.
  __device__ static __forceinline__ Index listed(const Index* list, Index at, int number) {
    const Index found = list[(std::size_t(at / kWarp) * net::kNeighbors + number) * kWarp + at % kWarp];
    return found == point::kNoNeighbor ? at : found;
  }
};

}  // namespace pointfair::cuda
