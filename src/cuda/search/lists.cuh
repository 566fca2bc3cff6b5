// SPDX-License-Identifier: Apache-2.0
// Neighbour lists as kernels see them.
#pragma once

#include "cuda/index/tree.cuh"

namespace pointfair::cuda {

// list[(leaf * k + slot) * 32 + lane], nearest first; sorted positions, kNoNeighbor at the end.
struct Lists {
  int k;
  const Index* list;

  __device__ const Index* of(std::size_t at) const { return list + (at / kWarp * k) * kWarp + at % kWarp; }
};

}  // namespace pointfair::cuda
