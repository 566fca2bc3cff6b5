// SPDX-License-Identifier: Apache-2.0
// Sorting networks in registers, where every loop unrolls, so that no array is indexed at run time, and one in memory.
#pragma once

#include <cstddef>

namespace pointfair::cuda {

__device__ __forceinline__ void order_pair(unsigned& a, unsigned& b) {
  const unsigned low = min(a, b);
  b = max(a, b);
  a = low;
}

// Batcher's odd-even merge of the elements kFirst, kFirst + kStep, ... of a run of kSize.
template <int kFirst, int kSize, int kStep, int kAll>
__device__ __forceinline__ void merge_network(unsigned (&v)[kAll]) {
  if constexpr (2 * kStep < kSize) {
    merge_network<kFirst, kSize, 2 * kStep>(v);
    merge_network<kFirst + kStep, kSize, 2 * kStep>(v);
#pragma unroll
    for (int i = kFirst + kStep; i + kStep < kFirst + kSize; i += 2 * kStep) order_pair(v[i], v[i + kStep]);
  } else {
    order_pair(v[kFirst], v[kFirst + kStep]);
  }
}
template <int kFirst, int kSize, int kAll>
__device__ __forceinline__ void sort_network(unsigned (&v)[kAll]) {
  if constexpr (kSize > 1) {
    sort_network<kFirst, kSize / 2>(v);
    sort_network<kFirst + kSize / 2, kSize / 2>(v);
    merge_network<kFirst, kSize, 1>(v);
  }
}

// Keeps the smallest of a sorted list and an unsorted batch in the list, sorted; `rejected` becomes the least of what
// either ever lost. A sorted list and the reverse of a sorted batch, taken element by element, give a bitonic sequence.
template <int kSize, int kBatch>
__device__ __forceinline__ void merge_batch(unsigned (&list)[kSize], unsigned (&batch)[kBatch], unsigned& rejected) {
  sort_network<0, kBatch>(batch);
#pragma unroll
  for (int i = 0; i < kBatch; ++i) {
    unsigned& kept = list[kSize - kBatch + i];
    const unsigned candidate = batch[kBatch - 1 - i];
    rejected = min(rejected, max(kept, candidate));
    kept = min(kept, candidate);
  }
#pragma unroll
  for (int stride = kSize / 2; stride > 0; stride /= 2) {
#pragma unroll
    for (int i = 0; i < kSize; ++i)
      if ((i & stride) == 0) order_pair(list[i], list[i + stride]);
  }
}

// Sorts any `count` by all `threads` of a block, where exchange(i, j) puts what stands at i < j in order. A bitonic
// network (Batcher 1968) whose merges begin with mirrored places, so that all runs ascend, and what lacks to a power of
// two would stay at the end. Nobody reads the result before the barrier it ends with.
template <class Exchange>
__device__ void sort_by_block(std::size_t count, unsigned threads, Exchange exchange) {
  std::size_t pairs = 1;
  while (2 * pairs < count) pairs *= 2;
  const auto step = [&](auto pair) {
    for (std::size_t n = threadIdx.x; n < pairs; n += threads) {
      const auto [i, j] = pair(n);
      if (j < count) exchange(i, j);
    }
    __syncthreads();
  };
  struct Pair {
    std::size_t i, j;
  };
  for (std::size_t run = 2; run <= 2 * pairs; run *= 2) {
    step([run](std::size_t n) {
      const std::size_t i = n & (run / 2 - 1), start = 2 * (n - i);
      return Pair{start + i, start + run - 1 - i};
    });
    for (std::size_t stride = run / 4; stride > 0; stride /= 2)
      step([stride](std::size_t n) {
        const std::size_t i = 2 * n - (n & (stride - 1));
        return Pair{i, i + stride};
      });
  }
}

}  // namespace pointfair::cuda
