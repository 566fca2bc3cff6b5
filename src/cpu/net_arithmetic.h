// SPDX-License-Identifier: Apache-2.0
// Products of whole numbers as the net of method learned needs them. Activations are at most 127 and weights at least
// -127, so two products fit into 16 bits and no instruction saturates: all variants give the same numbers. Part of
// src/cpu/kernels.cpp.
#pragma once

#include "cpu/pack.h"
#include "point/net.h"

namespace pointfair::cpu::POINTFAIR_ISA {

namespace net = point::net;

POINTFAIR_INLINE Ints operator+(Ints a, Ints b) { return {a.v + b.v}; }
POINTFAIR_INLINE Ints operator<<(Ints a, int bits) { return {IntVector(UnsignedVector(a.v) << unsigned(bits))}; }
POINTFAIR_INLINE Ints truncated(Floats a) { return {__builtin_convertvector(a.v, IntVector)}; }

// One sum for each channel.
struct alignas(64) Sums {
  int of[net::kChannels];
};

#if defined(__AVX512F__)
inline constexpr int kSumLanes = 16;
using SumVector = __m512i;
POINTFAIR_INLINE SumVector load_sums(const int* p) { return _mm512_loadu_si512(p); }
POINTFAIR_INLINE void store_sums(int* p, SumVector a) { _mm512_storeu_si512(p, a); }
POINTFAIR_INLINE SumVector add_word(SumVector sum, int word, const std::int8_t* weights) {
  const __m512i pairs = _mm512_maddubs_epi16(_mm512_set1_epi32(word), _mm512_loadu_si512(weights));
  return _mm512_add_epi32(sum, _mm512_madd_epi16(pairs, _mm512_set1_epi16(1)));
}
POINTFAIR_INLINE SumVector add_stored(SumVector sum, const std::int16_t* stored) {
  const __m512i wide = _mm512_cvtepi16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(stored)));
  return _mm512_add_epi32(sum, _mm512_slli_epi32(wide, net::kStoredShift));
}
#elif defined(__AVX2__)
inline constexpr int kSumLanes = 8;
using SumVector = __m256i;
POINTFAIR_INLINE SumVector load_sums(const int* p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); }
POINTFAIR_INLINE void store_sums(int* p, SumVector a) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), a); }
POINTFAIR_INLINE SumVector add_word(SumVector sum, int word, const std::int8_t* weights) {
  const __m256i w = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(weights));
  const __m256i pairs = _mm256_maddubs_epi16(_mm256_set1_epi32(word), w);
  return _mm256_add_epi32(sum, _mm256_madd_epi16(pairs, _mm256_set1_epi16(1)));
}
POINTFAIR_INLINE SumVector add_stored(SumVector sum, const std::int16_t* stored) {
  const __m256i wide = _mm256_cvtepi16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(stored)));
  return _mm256_add_epi32(sum, _mm256_slli_epi32(wide, net::kStoredShift));
}
#else
inline constexpr int kSumLanes = 4;
struct SumVector {
  int v[4];
};
POINTFAIR_INLINE SumVector load_sums(const int* p) { return {{p[0], p[1], p[2], p[3]}}; }
POINTFAIR_INLINE void store_sums(int* p, SumVector a) {
  for (int lane = 0; lane < 4; ++lane) p[lane] = a.v[lane];
}
POINTFAIR_INLINE SumVector add_word(SumVector sum, int word, const std::int8_t* weights) {
  for (int lane = 0; lane < 4; ++lane)
    for (int byte = 0; byte < 4; ++byte) sum.v[lane] += (word >> 8 * byte & 127) * weights[4 * lane + byte];
  return sum;
}
POINTFAIR_INLINE SumVector add_stored(SumVector sum, const std::int16_t* stored) {
  for (int lane = 0; lane < 4; ++lane) sum.v[lane] += stored[lane] * (1 << net::kStoredShift);
  return sum;
}
#endif
inline constexpr int kSumVectors = net::kChannels / kSumLanes;

// sums += weights x inputs, which are `count` words.
POINTFAIR_INLINE void add_products(const int* words, int count, const std::int8_t* weights, Sums& sums) {
  SumVector sum[kSumVectors];
  for (int v = 0; v < kSumVectors; ++v) sum[v] = load_sums(sums.of + v * kSumLanes);
  for (int w = 0; w < count; ++w, weights += 4 * net::kChannels)
    for (int v = 0; v < kSumVectors; ++v) sum[v] = add_word(sum[v], words[w], weights + 4 * v * kSumLanes);
  for (int v = 0; v < kSumVectors; ++v) store_sums(sums.of + v * kSumLanes, sum[v]);
}

// Sums to activations, as bytes.
POINTFAIR_INLINE void to_activations(const Sums& sums, std::uint8_t* out) {
  for (int c = 0; c < net::kChannels; ++c) {
    const int value = (sums.of[c] + (1 << (net::kSumShift - 1))) >> net::kSumShift;
    out[c] = static_cast<std::uint8_t>(value < 0 ? 0 : value > 127 ? 127 : value);
  }
}
// To what is kept for the neighbours.
POINTFAIR_INLINE void to_stored(const Sums& sums, std::int16_t* out) {
  for (int c = 0; c < net::kChannels; ++c) {
    const int value = (sums.of[c] + (1 << (net::kStoredShift - 1))) >> net::kStoredShift;
    out[c] = static_cast<std::int16_t>(value < -32768 ? -32768 : value > 32767 ? 32767 : value);
  }
}

// What an edge makes of the point's own part, of its neighbour's and of its features.
POINTFAIR_INLINE void edge_activations(const Sums& own, const std::int16_t* there, const int* words,
                                       const std::int8_t* weights, std::uint8_t* out) {
  Sums sums;
  for (int v = 0; v < kSumVectors; ++v) {
    SumVector sum = add_stored(load_sums(own.of + v * kSumLanes), there + v * kSumLanes);
    for (int w = 0; w < net::kEdgeWords; ++w)
      sum = add_word(sum, words[w], weights + 4 * (w * net::kChannels + v * kSumLanes));
    store_sums(sums.of + v * kSumLanes, sum);
  }
  to_activations(sums, out);
}

// One row of weights times activations.
POINTFAIR_INLINE int product(const std::uint8_t* activations, const std::int8_t* weights) {
  int sum = 0;
  for (int c = 0; c < net::kChannels; ++c) sum += activations[c] * weights[c];
  return sum;
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
