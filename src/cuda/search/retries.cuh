// SPDX-License-Identifier: Apache-2.0
// Work that one kernel leaves to the next, and the launch of single searches.
#pragma once

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "cuda/search/search.cuh"
#include "cuda/search/single_lists.cuh"

namespace pointfair::cuda {

// Leave work to the exact searches. Its order differs from run to run; no result depends on it.
__device__ inline void retry(CloudState* state, Index* retries, Index at, bool wanted) {
  const unsigned all = __ballot_sync(kAllLanes, wanted);
  if (all == 0) return;
  Index first = 0;
  if (lane_number() == 0) first = atomicAdd(&state->retries, static_cast<Index>(__popc(all)));
  first = __shfl_sync(kAllLanes, first, 0);
  if (wanted) retries[first + __popc(all & lanes_below())] = at;
}
__device__ inline void retry_leaf(CloudState* state, HardLeaf* retries, HardLeaf leaf) {
  if (lane_number() == 0) retries[atomicAdd(&state->leaf_retries, 1u)] = leaf;
}

// Shared memory for `warps` lists of `size`, more than a kernel may have without asking.
template <class Kernel>
std::size_t allow_list_memory(Kernel kernel, int warps, int size) {
  const std::size_t bytes = warps * SharedList::bytes(size);
  check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes)),
        "preparing the exact search");
  return bytes;
}

}  // namespace pointfair::cuda
