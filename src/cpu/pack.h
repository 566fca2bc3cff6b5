// SPDX-License-Identifier: Apache-2.0
// Packs of floats and of 32-bit integers, as wide as the instruction set that this file is compiled for. The formulas
// of src/point run on them lane by lane; each lane rounds exactly as a single float would. Only for
// src/cpu/kernels.cpp, which is compiled once per instruction set: everything lives in a namespace named after it, so
// that no function compiled for one processor can stand in for another's.
#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include "point/neighbors.h"
#include "point/vec.h"

#ifndef POINTFAIR_ISA
#error "POINTFAIR_ISA names the instruction set's namespace"
#endif

namespace pointfair::cpu::POINTFAIR_ISA {

#if defined(__AVX512F__)
inline constexpr int kLanes = 16;
#elif defined(__AVX2__)
inline constexpr int kLanes = 8;
#else
inline constexpr int kLanes = 4;
#endif

typedef float FloatVector __attribute__((vector_size(4 * kLanes)));
typedef int IntVector __attribute__((vector_size(4 * kLanes)));
typedef unsigned UnsignedVector __attribute__((vector_size(4 * kLanes)));
typedef float LooseFloatVector __attribute__((vector_size(4 * kLanes), aligned(4)));
typedef int LooseIntVector __attribute__((vector_size(4 * kLanes), aligned(4)));

struct Floats {
  FloatVector v;
  Floats() = default;
  POINTFAIR_INLINE Floats(FloatVector vector) : v(vector) {}
  POINTFAIR_INLINE explicit Floats(float x);  // the same in every lane
};
struct Ints {
  IntVector v;
};

#if defined(__AVX512F__)
// One bit a lane, lane 0 lowest.
struct Mask {
  __mmask16 v;
};
POINTFAIR_INLINE unsigned bits(Mask m) { return m.v; }
POINTFAIR_INLINE Mask mask_of(unsigned bits) { return {__mmask16(bits)}; }
POINTFAIR_INLINE Mask operator&(Mask a, Mask b) { return {__mmask16(a.v & b.v)}; }
POINTFAIR_INLINE Mask operator|(Mask a, Mask b) { return {__mmask16(a.v | b.v)}; }
POINTFAIR_INLINE Mask operator~(Mask a) { return {__mmask16(~a.v)}; }

POINTFAIR_INLINE Floats broadcast(float x) { return {_mm512_set1_ps(x)}; }
POINTFAIR_INLINE Ints broadcast(int x) { return {IntVector(_mm512_set1_epi32(x))}; }
POINTFAIR_INLINE Mask operator<(Floats a, Floats b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)}; }
POINTFAIR_INLINE Mask operator>(Floats a, Floats b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_GT_OQ)}; }
POINTFAIR_INLINE Mask operator<=(Floats a, Floats b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)}; }
POINTFAIR_INLINE Mask operator==(Floats a, Floats b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_EQ_OQ)}; }
POINTFAIR_INLINE Mask operator<(Ints a, Ints b) { return {_mm512_cmplt_epi32_mask(__m512i(a.v), __m512i(b.v))}; }
POINTFAIR_INLINE Mask operator==(Ints a, Ints b) { return {_mm512_cmpeq_epi32_mask(__m512i(a.v), __m512i(b.v))}; }
POINTFAIR_INLINE Mask operator!=(Ints a, Ints b) { return {_mm512_cmpneq_epi32_mask(__m512i(a.v), __m512i(b.v))}; }
POINTFAIR_INLINE Floats select(Mask condition, Floats yes, Floats no) {
  return {_mm512_mask_blend_ps(condition.v, no.v, yes.v)};
}
POINTFAIR_INLINE Ints select(Mask condition, Ints yes, Ints no) {
  return {IntVector(_mm512_mask_blend_epi32(condition.v, __m512i(no.v), __m512i(yes.v)))};
}
#else
// All bits of a lane set, or none.
struct Mask {
  IntVector v;
};
POINTFAIR_INLINE unsigned bits(Mask m) {
#if defined(__AVX2__)
  return unsigned(_mm256_movemask_ps(__m256(m.v)));
#elif defined(__SSE2__)
  return unsigned(_mm_movemask_ps(__m128(m.v)));
#elif defined(__aarch64__)
  const uint32x4_t of_lanes = {1, 2, 4, 8};
  return vaddvq_u32(vandq_u32(uint32x4_t(m.v), of_lanes));
#else
  unsigned result = 0;
  for (int lane = 0; lane < kLanes; ++lane) result |= unsigned(m.v[lane] & 1) << lane;
  return result;
#endif
}
POINTFAIR_INLINE Mask mask_of(unsigned bits) {
  Mask result;
  for (int lane = 0; lane < kLanes; ++lane) result.v[lane] = -int(bits >> lane & 1u);
  return result;
}
POINTFAIR_INLINE Mask operator&(Mask a, Mask b) { return {a.v & b.v}; }
POINTFAIR_INLINE Mask operator|(Mask a, Mask b) { return {a.v | b.v}; }
POINTFAIR_INLINE Mask operator~(Mask a) { return {~a.v}; }

// Of a comparison. To clang it is one bit a lane: where two meet, it packs eight lanes into half a register, which
// costs a default run with AVX2 a twentieth of its time. So it must not see where the lanes come from.
POINTFAIR_INLINE Mask as_mask(IntVector lanes) {
#if defined(__clang__) && defined(__AVX2__)
  asm("" : "+x"(lanes));
#endif
  return {lanes};
}

// In intrinsics, since GCC 12 makes several instructions of a loop over the lanes and of a choice by `?:`.
POINTFAIR_INLINE Floats broadcast(float x) {
#if defined(__AVX2__)
  return {_mm256_set1_ps(x)};
#elif defined(__SSE2__)
  return {_mm_set1_ps(x)};
#elif defined(__aarch64__)
  return {FloatVector(vdupq_n_f32(x))};
#else
  Floats result;
  for (int lane = 0; lane < kLanes; ++lane) result.v[lane] = x;
  return result;
#endif
}
POINTFAIR_INLINE Ints broadcast(int x) { return {IntVector{} + x}; }
POINTFAIR_INLINE Mask operator<(Floats a, Floats b) { return as_mask(a.v < b.v); }
POINTFAIR_INLINE Mask operator>(Floats a, Floats b) { return as_mask(a.v > b.v); }
POINTFAIR_INLINE Mask operator<=(Floats a, Floats b) { return as_mask(a.v <= b.v); }
POINTFAIR_INLINE Mask operator==(Floats a, Floats b) { return as_mask(a.v == b.v); }
POINTFAIR_INLINE Mask operator<(Ints a, Ints b) { return as_mask(a.v < b.v); }
POINTFAIR_INLINE Mask operator==(Ints a, Ints b) { return as_mask(a.v == b.v); }
POINTFAIR_INLINE Mask operator!=(Ints a, Ints b) { return as_mask(a.v != b.v); }
#if defined(__AVX2__)
POINTFAIR_INLINE Floats select(Mask condition, Floats yes, Floats no) {
  return {_mm256_blendv_ps(no.v, yes.v, __m256(condition.v))};
}
POINTFAIR_INLINE Ints select(Mask condition, Ints yes, Ints no) {
  return {IntVector(_mm256_blendv_epi8(__m256i(no.v), __m256i(yes.v), __m256i(condition.v)))};
}
#else
POINTFAIR_INLINE Ints select(Mask condition, Ints yes, Ints no) {
  return {(condition.v & yes.v) | (~condition.v & no.v)};
}
POINTFAIR_INLINE Floats select(Mask condition, Floats yes, Floats no) {
  return {FloatVector(select(condition, Ints{IntVector(yes.v)}, Ints{IntVector(no.v)}).v)};
}
#endif
#endif
POINTFAIR_INLINE Floats::Floats(float x) : v(broadcast(x).v) {}

POINTFAIR_INLINE Ints operator&(Ints a, int b) { return {a.v & b}; }
POINTFAIR_INLINE Ints operator|(Ints a, int b) { return {a.v | b}; }
POINTFAIR_INLINE Ints as_ints(Floats a) { return {IntVector(a.v)}; }
POINTFAIR_INLINE Floats as_floats(Ints a) { return {FloatVector(a.v)}; }
POINTFAIR_INLINE Ints truncated(Floats a) { return {__builtin_convertvector(a.v, IntVector)}; }
POINTFAIR_INLINE Floats as_numbers(Ints a) { return {__builtin_convertvector(a.v, FloatVector)}; }

// As point::smaller and point::larger, in one instruction: `a` where neither is smaller, or one is NaN.
#if defined(__AVX512F__)
POINTFAIR_INLINE Floats smaller(Floats a, Floats b) { return {_mm512_min_ps(b.v, a.v)}; }
POINTFAIR_INLINE Floats larger(Floats a, Floats b) { return {_mm512_max_ps(b.v, a.v)}; }
POINTFAIR_INLINE Ints smaller(Ints a, Ints b) { return {IntVector(_mm512_min_epi32(__m512i(a.v), __m512i(b.v)))}; }
POINTFAIR_INLINE Ints larger(Ints a, Ints b) { return {IntVector(_mm512_max_epi32(__m512i(a.v), __m512i(b.v)))}; }
#elif defined(__AVX2__)
POINTFAIR_INLINE Floats smaller(Floats a, Floats b) { return {_mm256_min_ps(b.v, a.v)}; }
POINTFAIR_INLINE Floats larger(Floats a, Floats b) { return {_mm256_max_ps(b.v, a.v)}; }
POINTFAIR_INLINE Ints smaller(Ints a, Ints b) { return {IntVector(_mm256_min_epi32(__m256i(a.v), __m256i(b.v)))}; }
POINTFAIR_INLINE Ints larger(Ints a, Ints b) { return {IntVector(_mm256_max_epi32(__m256i(a.v), __m256i(b.v)))}; }
#else
#if defined(__SSE2__)
POINTFAIR_INLINE Floats smaller(Floats a, Floats b) { return {_mm_min_ps(b.v, a.v)}; }
POINTFAIR_INLINE Floats larger(Floats a, Floats b) { return {_mm_max_ps(b.v, a.v)}; }
#else
POINTFAIR_INLINE Floats smaller(Floats a, Floats b) { return select(b < a, b, a); }
POINTFAIR_INLINE Floats larger(Floats a, Floats b) { return select(a < b, b, a); }
#endif
POINTFAIR_INLINE Ints smaller(Ints a, Ints b) { return select(b < a, b, a); }
POINTFAIR_INLINE Ints larger(Ints a, Ints b) { return select(a < b, b, a); }
#endif
#if defined(__aarch64__)
POINTFAIR_INLINE bool any(Mask m) { return vmaxvq_u32(uint32x4_t(m.v)) != 0; }
#else
POINTFAIR_INLINE bool any(Mask m) { return bits(m) != 0; }
#endif

POINTFAIR_INLINE Floats load(const float* p) { return {FloatVector(*reinterpret_cast<const LooseFloatVector*>(p))}; }
POINTFAIR_INLINE Ints load(const int* p) { return {IntVector(*reinterpret_cast<const LooseIntVector*>(p))}; }
POINTFAIR_INLINE Ints load(const unsigned* p) { return load(reinterpret_cast<const int*>(p)); }
POINTFAIR_INLINE void store(float* p, Floats a) { *reinterpret_cast<LooseFloatVector*>(p) = a.v; }
POINTFAIR_INLINE void store(unsigned* p, Ints a) { *reinterpret_cast<LooseIntVector*>(p) = a.v; }

POINTFAIR_INLINE Floats operator+(Floats a, Floats b) { return {a.v + b.v}; }
POINTFAIR_INLINE Floats operator-(Floats a, Floats b) { return {a.v - b.v}; }
POINTFAIR_INLINE Floats operator*(Floats a, Floats b) { return {a.v * b.v}; }
POINTFAIR_INLINE Floats operator/(Floats a, Floats b) { return {a.v / b.v}; }
POINTFAIR_INLINE Floats operator+(Floats a, float b) { return a + broadcast(b); }
POINTFAIR_INLINE Floats operator-(Floats a, float b) { return a - broadcast(b); }
POINTFAIR_INLINE Floats operator*(Floats a, float b) { return a * broadcast(b); }
POINTFAIR_INLINE Floats operator/(Floats a, float b) { return a / broadcast(b); }
POINTFAIR_INLINE Floats operator*(float a, Floats b) { return broadcast(a) * b; }
POINTFAIR_INLINE Floats operator-(float a, Floats b) { return broadcast(a) - b; }
POINTFAIR_INLINE Floats operator-(Floats a) { return {-a.v}; }

POINTFAIR_INLINE Floats square_root(Floats a) {
#if defined(__AVX512F__)
  return {_mm512_sqrt_ps(a.v)};
#elif defined(__AVX2__)
  return {_mm256_sqrt_ps(a.v)};
#elif defined(__SSE2__)
  return {_mm_sqrt_ps(a.v)};
#elif defined(__aarch64__)
  return {FloatVector(vsqrtq_f32(float32x4_t(a.v)))};
#else
  Floats root;
  for (int lane = 0; lane < kLanes; ++lane) root.v[lane] = __builtin_sqrtf(a.v[lane]);
  return root;
#endif
}

POINTFAIR_INLINE Floats counted(Floats count, Mask one_more) {
  return count + select(one_more, broadcast(1.0f), broadcast(0.0f));
}
POINTFAIR_INLINE Floats absolute(Floats a) { return as_floats(as_ints(a) & 0x7fffffff); }

// Unsigned: of a number that is too small the exponent wraps round, and nobody reads it.
POINTFAIR_INLINE Floats power_of_two_times(Floats value, Floats shifted) {
  return {FloatVector(UnsignedVector(value.v) + (UnsignedVector(shifted.v) << 23))};
}

// base[index] in each lane; every index must be valid. By single loads, since
// the processor's own gather takes longer, on some processors much longer.
POINTFAIR_INLINE Floats gather(const float* base, Ints index) {
  unsigned at[kLanes];
  store(at, index);
#if defined(__AVX2__)
  const auto four = [&](int i) { return _mm_setr_ps(base[at[i]], base[at[i + 1]], base[at[i + 2]], base[at[i + 3]]); };
  const auto eight = [&](int i) { return _mm256_insertf128_ps(_mm256_castps128_ps256(four(i)), four(i + 4), 1); };
#if defined(__AVX512F__)
  return {_mm512_insertf32x8(_mm512_castps256_ps512(eight(0)), eight(8), 1)};
#else
  return {eight(0)};
#endif
#else
  Floats result;
  for (int lane = 0; lane < kLanes; ++lane) result.v[lane] = base[at[lane]];
  return result;
#endif
}
POINTFAIR_INLINE Ints gather(const int* base, Ints index) {
  unsigned at[kLanes];
  store(at, index);
  Ints result;
  for (int lane = 0; lane < kLanes; ++lane) result.v[lane] = base[at[lane]];
  return result;
}

// No lane may be NaN, which instruction sets treat differently.
POINTFAIR_INLINE float largest(Floats a) {
#if defined(__AVX512F__)
  return _mm512_reduce_max_ps(a.v);
#elif defined(__SSE2__)
#if defined(__AVX2__)
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
#else
  const __m128 four = a.v;
#endif
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps(two, two, 1)));
#elif defined(__aarch64__)
  return vmaxvq_f32(float32x4_t(a.v));
#else
  float result = a.v[0];
  for (int lane = 1; lane < kLanes; ++lane) result = a.v[lane] > result ? a.v[lane] : result;
  return result;
#endif
}
POINTFAIR_INLINE float smallest(Floats a) { return -largest(-a); }

POINTFAIR_INLINE point::Vec3<Floats> spread(float x, float y, float z) {
  return {broadcast(x), broadcast(y), broadcast(z)};
}

POINTFAIR_INLINE Ints lane_numbers() {
  Ints numbers;
  for (int lane = 0; lane < kLanes; ++lane) numbers.v[lane] = lane;
  return numbers;
}

#if defined(__AVX2__) && !defined(__AVX512F__)
// The numbers of the bits that are set in i, a byte each, lowest first.
struct BitNumbers {
  unsigned long long of[256] = {};
  constexpr BitNumbers() {
    for (int i = 0; i < 256; ++i)
      for (int bit = 7; bit >= 0; --bit)
        if (i >> bit & 1) of[i] = of[i] << 8 | unsigned(bit);
  }
};
inline constexpr BitNumbers kBitNumbers;
#endif

// Appends the numbers first + lane of the chosen lanes to `out`, which has room for a whole pack; returns how many.
POINTFAIR_INLINE int append_lanes(int* out, int first, unsigned lanes) {
#if defined(__AVX512F__)
  _mm512_storeu_si512(out, _mm512_maskz_compress_epi32(__mmask16(lanes), __m512i(lane_numbers().v + first)));
  return __builtin_popcount(lanes);
#elif defined(__AVX2__)  // without a branch that is hard to guess
  const __m256i numbers =
      _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(&kBitNumbers.of[lanes])));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_add_epi32(numbers, _mm256_set1_epi32(first)));
  return __builtin_popcount(lanes);
#else
  int count = 0;
  for (; lanes != 0; lanes &= lanes - 1) out[count++] = first + __builtin_ctz(lanes);
  return count;
#endif
}
POINTFAIR_INLINE int append(int* out, int first, Mask chosen) { return append_lanes(out, first, bits(chosen)); }

}  // namespace pointfair::cpu::POINTFAIR_ISA
