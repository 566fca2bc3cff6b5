// SPDX-License-Identifier: Apache-2.0
// Sorting networks (K. Batcher, "Sorting networks and their applications", 1968), one sequence a lane; every loop
// unrolls, so that short sequences stay in registers. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/pack.h"

namespace pointfair::cpu::POINTFAIR_ISA {

template <class T>
POINTFAIR_INLINE void order_pair(T& a, T& b) {
  const T low = smaller(a, b);
  b = larger(a, b);
  a = low;
}

// Odd-even merge of the elements kFirst, kFirst + kStep, ... of a run of kSize whose halves are sorted.
template <int kFirst, int kSize, int kStep, class T>
POINTFAIR_INLINE void merge_halves(T* v) {
  if constexpr (2 * kStep < kSize) {
    merge_halves<kFirst, kSize, 2 * kStep>(v);
    merge_halves<kFirst + kStep, kSize, 2 * kStep>(v);
#pragma GCC unroll 16
    for (int i = kFirst + kStep; i + kStep < kFirst + kSize; i += 2 * kStep) order_pair(v[i], v[i + kStep]);
  } else {
    order_pair(v[kFirst], v[kFirst + kStep]);
  }
}

template <int kFirst, int kSize, class T>
POINTFAIR_INLINE void sort_run(T* v) {
  if constexpr (kSize > 1) {
    sort_run<kFirst, kSize / 2>(v);
    sort_run<kFirst + kSize / 2, kSize / 2>(v);
    merge_halves<kFirst, kSize, 1>(v);
  }
}

// Sorts a sequence of kSize - kBefore elements that first rises and then falls, as if kBefore lesser ones stood before
// it, which need no exchange.
template <int kSize, int kBefore = 0, class T>
POINTFAIR_INLINE void sort_bitonic(T* v) {
#pragma GCC unroll 8
  for (int stride = kSize / 2; stride > 0; stride /= 2) {
#pragma GCC unroll 64
    for (int i = kBefore; i < kSize; ++i)
      if ((i & stride) == 0) order_pair(v[i - kBefore], v[i + stride - kBefore]);
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
