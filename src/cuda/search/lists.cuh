// SPDX-License-Identifier: Apache-2.0
// Neighbour lists as kernels see them.
#pragma once

#include "cuda/index/tree.cuh"

namespace pointfair::cuda {

// Of a leaf whose lists have a length of their own: list[begin + slot * 32 + lane].
struct LeafList {
  unsigned long long begin;
  int k;
};

// list[(leaf * k + slot) * 32 + lane], nearest first; sorted positions, kNoNeighbor at the end.
struct Lists {
  int k;
  const Index* list;
  const LeafList* of_leaves = nullptr;  // along a mesh, for those who ask for list_of() and length_of()

  __device__ const Index* of(std::size_t at) const { return list + (at / kWarp * k) * kWarp + at % kWarp; }
  __device__ const Index* list_of(std::size_t at) const {
    return of_leaves == nullptr ? of(at) : list + of_leaves[at / kWarp].begin + at % kWarp;
  }
  __device__ int length_of(std::size_t at) const { return of_leaves == nullptr ? k : of_leaves[at / kWarp].k; }
};

}  // namespace pointfair::cuda
