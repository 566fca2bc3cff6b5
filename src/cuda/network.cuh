// SPDX-License-Identifier: Apache-2.0
// Sorting networks in registers: every loop unrolls, so no array is indexed at run time.
#pragma once

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

}  // namespace pointfair::cuda
