// SPDX-License-Identifier: Apache-2.0
// Sums in the order of their items, as point::kSumBlock says: one warp adds what all warps have computed.
#pragma once

#include <cstddef>

#include "point/graph.h"

namespace pointfair::cuda {

inline constexpr int kSumThreads = 256;

// Called by all threads of a block of kSumThreads. Adds the kSums numbers that value_of(item, numbers) writes for each
// item of first <= item < end; thread s < kSums gets the sum of the s-th ones.
template <int kSums, class ValueOf>
__device__ double sum_in_order(std::size_t first, std::size_t end, const ValueOf& value_of) {
  // one is filled while the other is added; the odd length brings the sums to different banks
  __shared__ double values[2][kSums][kSumThreads + 1];
  double sum = 0;
  int turn = 0;
  for (std::size_t begin = first; begin < end; begin += kSumThreads, turn ^= 1) {
    double numbers[kSums] = {};  // a zero changes no sum
    if (begin + threadIdx.x < end) value_of(begin + threadIdx.x, numbers);
#pragma unroll
    for (int s = 0; s < kSums; ++s) values[turn][s][threadIdx.x] = numbers[s];
    __syncthreads();
    if (threadIdx.x < kSums) {
#pragma unroll 16
      for (int i = 0; i < kSumThreads; ++i) sum += values[turn][threadIdx.x][i];
    }
  }
  return sum;
}

// The items of this block of threads, where each has one block of the sum.
struct SumRange {
  std::size_t first, end;
  __device__ explicit SumRange(std::size_t items) : first(std::size_t(blockIdx.x) * point::kSumBlock) {
    end = first + point::kSumBlock < items ? first + point::kSumBlock : items;
  }
};

// The sums of blocks, added by a single block of threads; all its threads get them.
template <int kSums>
struct Totals {
  double of[kSums];
  __device__ Totals(const double* sums_of_blocks, std::size_t blocks) {
    __shared__ double totals[kSums];
    const double its = sum_in_order<kSums>(0, blocks, [&](std::size_t block, double* numbers) {
      for (int s = 0; s < kSums; ++s) numbers[s] = sums_of_blocks[block * kSums + s];
    });
    if (threadIdx.x < kSums) totals[threadIdx.x] = its;
    __syncthreads();
    for (int s = 0; s < kSums; ++s) of[s] = totals[s];
  }
};

}  // namespace pointfair::cuda
