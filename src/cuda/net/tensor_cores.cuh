// SPDX-License-Identifier: Apache-2.0
// Products of matrices of bytes by a warp (PTX ISA, mma.m16n8k16 and its like), on cards before Ampere in parts.
#pragma once

namespace pointfair::cuda {

// sums = from + a matrix of 16 x 16 bytes times one of 16 x 8, as the lanes of a warp hold them: this lane has of the
// first the words `low` and `high` of rows lane / 4 and 8 more, of the second `column` of column lane / 4, and of the
// sums columns 2 (lane % 4) and the next, of both rows.
__device__ __forceinline__ void multiply(int (&sums)[4], unsigned low, unsigned high, unsigned column,
                                         const int (&from)[4]) {
#if __CUDA_ARCH__ >= 800
  asm("mma.sync.aligned.m16n8k16.row.col.s32.s8.s8.s32 {%0,%1,%2,%3}, {%4,%5}, {%6}, {%7,%8,%9,%10};"
      : "=r"(sums[0]), "=r"(sums[1]), "=r"(sums[2]), "=r"(sums[3])
      : "r"(low), "r"(high), "r"(column), "r"(from[0]), "r"(from[1]), "r"(from[2]), "r"(from[3]));
#else
  asm("mma.sync.aligned.m8n8k16.row.col.s32.s8.s8.s32 {%0,%1}, {%2}, {%3}, {%4,%5};"
      : "=r"(sums[0]), "=r"(sums[1])
      : "r"(low), "r"(column), "r"(from[0]), "r"(from[1]));
  asm("mma.sync.aligned.m8n8k16.row.col.s32.s8.s8.s32 {%0,%1}, {%2}, {%3}, {%4,%5};"
      : "=r"(sums[2]), "=r"(sums[3])
      : "r"(high), "r"(column), "r"(from[2]), "r"(from[3]));
#endif
}
__device__ __forceinline__ void multiply(int (&sums)[4], unsigned low, unsigned high, unsigned column) {
  multiply(sums, low, high, column, sums);
}
// Of matrices twice as long.
__device__ __forceinline__ void multiply_two(int (&sums)[4], const unsigned (&a)[2], const unsigned (&b)[2],
                                             unsigned column_a, unsigned column_b, const int (&from)[4]) {
#if __CUDA_ARCH__ >= 800
  asm("mma.sync.aligned.m16n8k32.row.col.s32.s8.s8.s32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, {%10,%11,%12,%13};"
      : "=r"(sums[0]), "=r"(sums[1]), "=r"(sums[2]), "=r"(sums[3])
      : "r"(a[0]), "r"(a[1]), "r"(b[0]), "r"(b[1]), "r"(column_a), "r"(column_b), "r"(from[0]), "r"(from[1]),
        "r"(from[2]), "r"(from[3]));
#else
  multiply(sums, a[0], a[1], column_a, from);
  multiply(sums, b[0], b[1], column_b);
#endif
}

// The transpose of a matrix of 8 x 8 halves of words, a row of which four lanes hold.
__device__ __forceinline__ unsigned transposed(unsigned row) {
  unsigned column;
  asm("movmatrix.sync.aligned.m8n8.trans.b16 %0, %1;" : "=r"(column) : "r"(row));
  return column;
}

}  // namespace pointfair::cuda
