// SPDX-License-Identifier: Apache-2.0
// Products of whole numbers as the net of method learned needs them. Activations are at most 127 and weights at least
// -127, so two products fit into 16 bits and no instruction saturates: all variants give the same numbers. Part of
// src/cpu/net_kernels.cpp.
#pragma once

#include "cpu/pack.h"
#include "point/net.h"

namespace pointfair::cpu::POINTFAIR_ISA {

namespace net = point::net;

POINTFAIR_INLINE Ints operator+(Ints a, Ints b) { return {a.v + b.v}; }
POINTFAIR_INLINE Ints operator<<(Ints a, int bits) { return {IntVector(UnsignedVector(a.v) << unsigned(bits))}; }

// One sum for each channel.
struct alignas(64) Sums {
  int of[net::kChannels];
};
inline constexpr int kRounding = 1 << (net::kSumShift - 1), kStoredRounding = 1 << (net::kStoredShift - 1);

// Of each instruction set: a vector of sums of channels side by side, a product with a word of inputs, what a neighbour
// stored, and a row of sums (kSumVectors vectors, rounding already in them) as activations or as what is stored.
#if defined(__AVX512F__)
inline constexpr int kSumLanes = 16;
using SumVector = __m512i;
POINTFAIR_INLINE SumVector load_sums(const int* p) { return _mm512_loadu_si512(p); }
POINTFAIR_INLINE void store_sums(int* p, SumVector a) { _mm512_storeu_si512(p, a); }
POINTFAIR_INLINE SumVector broadcast_word(int word) { return _mm512_set1_epi32(word); }
POINTFAIR_INLINE SumVector add_word(SumVector sum, SumVector word, const std::int8_t* weights) {
#if defined(__AVX512VNNI__)
  return _mm512_dpbusd_epi32(sum, word, _mm512_loadu_si512(weights));
#else
  const __m512i pairs = _mm512_maddubs_epi16(word, _mm512_loadu_si512(weights));
  return _mm512_add_epi32(sum, _mm512_madd_epi16(pairs, _mm512_set1_epi16(1)));
#endif
}
POINTFAIR_INLINE SumVector add_stored(SumVector sum, const std::int16_t* stored) {
  const __m512i wide = _mm512_cvtepi16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(stored)));
  return _mm512_add_epi32(sum, _mm512_slli_epi32(wide, net::kStoredShift));
}
POINTFAIR_INLINE void store_activations(const SumVector* sums, std::uint8_t* out) {
  for (int v = 0; v < net::kChannels / kSumLanes; ++v) {
    const __m512i value = _mm512_max_epi32(_mm512_srai_epi32(sums[v], net::kSumShift), _mm512_setzero_si512());
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + v * kSumLanes), _mm512_cvtsepi32_epi8(value));
  }
}
POINTFAIR_INLINE void store_for_neighbors(const SumVector* sums, std::int16_t* out) {
  for (int v = 0; v < net::kChannels / kSumLanes; ++v)
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + v * kSumLanes),
                        _mm512_cvtsepi32_epi16(_mm512_srai_epi32(sums[v], net::kStoredShift)));
}
#elif defined(__AVX2__)
inline constexpr int kSumLanes = 8;
using SumVector = __m256i;
POINTFAIR_INLINE SumVector load_sums(const int* p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); }
POINTFAIR_INLINE void store_sums(int* p, SumVector a) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), a); }
POINTFAIR_INLINE SumVector broadcast_word(int word) { return _mm256_set1_epi32(word); }
POINTFAIR_INLINE SumVector add_word(SumVector sum, SumVector word, const std::int8_t* weights) {
  const __m256i w = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(weights));
#if defined(__AVXVNNI__)
  return _mm256_dpbusd_avx_epi32(sum, word, w);
#else
  return _mm256_add_epi32(sum, _mm256_madd_epi16(_mm256_maddubs_epi16(word, w), _mm256_set1_epi16(1)));
#endif
}
POINTFAIR_INLINE SumVector add_stored(SumVector sum, const std::int16_t* stored) {
  const __m256i wide = _mm256_cvtepi16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(stored)));
  return _mm256_add_epi32(sum, _mm256_slli_epi32(wide, net::kStoredShift));
}
// Packing goes half by half, so that what it makes is brought into order after it.
POINTFAIR_INLINE __m256i packed_sums(SumVector a, SumVector b, int shift) {
  return _mm256_packs_epi32(_mm256_srai_epi32(a, shift), _mm256_srai_epi32(b, shift));
}
POINTFAIR_INLINE void store_activations(const SumVector* sums, std::uint8_t* out) {
  static_assert(net::kChannels == 6 * kSumLanes);
  const __m256i most = _mm256_set1_epi8(127), order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
  const __m256i a = packed_sums(sums[0], sums[1], net::kSumShift), b = packed_sums(sums[2], sums[3], net::kSumShift),
                c = packed_sums(sums[4], sums[5], net::kSumShift);
  const __m256i first = _mm256_permutevar8x32_epi32(_mm256_min_epu8(_mm256_packus_epi16(a, b), most), order);
  const __m256i last = _mm256_permutevar8x32_epi32(_mm256_min_epu8(_mm256_packus_epi16(c, c), most), order);
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), first);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out + 32), _mm256_castsi256_si128(last));
}
POINTFAIR_INLINE void store_for_neighbors(const SumVector* sums, std::int16_t* out) {
  for (int v = 0; v < net::kChannels / kSumLanes; v += 2) {
    const __m256i packed = packed_sums(sums[v], sums[v + 1], net::kStoredShift);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + v * kSumLanes), _mm256_permute4x64_epi64(packed, 0xd8));
  }
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
POINTFAIR_INLINE int broadcast_word(int word) { return word; }
POINTFAIR_INLINE SumVector add_word(SumVector sum, int word, const std::int8_t* weights) {
  for (int lane = 0; lane < 4; ++lane)
    for (int byte = 0; byte < 4; ++byte) sum.v[lane] += (word >> 8 * byte & 127) * weights[4 * lane + byte];
  return sum;
}
POINTFAIR_INLINE SumVector add_stored(SumVector sum, const std::int16_t* stored) {
  for (int lane = 0; lane < 4; ++lane) sum.v[lane] += stored[lane] * (1 << net::kStoredShift);
  return sum;
}
POINTFAIR_INLINE void store_activations(const SumVector* sums, std::uint8_t* out) {
  for (int c = 0; c < net::kChannels; ++c) {
    const int value = sums[c / kSumLanes].v[c % kSumLanes] >> net::kSumShift;
    out[c] = static_cast<std::uint8_t>(value < 0 ? 0 : value > 127 ? 127 : value);
  }
}
POINTFAIR_INLINE void store_for_neighbors(const SumVector* sums, std::int16_t* out) {
  for (int c = 0; c < net::kChannels; ++c) {
    const int value = sums[c / kSumLanes].v[c % kSumLanes] >> net::kStoredShift;
    out[c] = static_cast<std::int16_t>(value < -32768 ? -32768 : value > 32767 ? 32767 : value);
  }
}
#endif
inline constexpr int kSumVectors = net::kChannels / kSumLanes;

// The sums of one point as vectors.
struct SumRow {
  SumVector of[kSumVectors];

  // From `bias`, null for 0, with the rounding of what comes after.
  POINTFAIR_INLINE SumRow(const int* bias, int rounding) {
    Sums from;
    for (int c = 0; c < net::kChannels; ++c) from.of[c] = (bias != nullptr ? bias[c] : 0) + rounding;
    for (int v = 0; v < kSumVectors; ++v) of[v] = load_sums(from.of + v * kSumLanes);
  }
  // Adds weights x inputs, which are `count` bytes, a multiple of 4.
  POINTFAIR_INLINE void add_products(const std::uint8_t* inputs, int count, const std::int8_t* weights) {
    for (int i = 0; i < count; i += 4, weights += 4 * net::kChannels) {
      int word;
      __builtin_memcpy(&word, inputs + i, sizeof word);
      const auto all = broadcast_word(word);
      for (int v = 0; v < kSumVectors; ++v) of[v] = add_word(of[v], all, weights + 4 * v * kSumLanes);
    }
  }
};

// What an edge makes of the point's own part, of its neighbour's and of its features.
POINTFAIR_INLINE void edge_activations(const SumRow& own, const std::int16_t* there, const int* words,
                                       const std::int8_t* weights, std::uint8_t* out) {
  SumVector sums[kSumVectors];
  for (int v = 0; v < kSumVectors; ++v) sums[v] = add_stored(own.of[v], there + v * kSumLanes);
  for (int w = 0; w < net::kEdgeWords; ++w) {
    const auto all = broadcast_word(words[w]);
    for (int v = 0; v < kSumVectors; ++v)
      sums[v] = add_word(sums[v], all, weights + 4 * (w * net::kChannels + v * kSumLanes));
  }
  store_activations(sums, out);
}

// One row of weights times activations.
POINTFAIR_INLINE int product(const std::uint8_t* activations, const std::int8_t* weights) {
  int sum = 0;
  for (int c = 0; c < net::kChannels; ++c) sum += activations[c] * weights[c];
  return sum;
}

// The gates of an edge: rows of weights times its activations. Writes 4 numbers, of which the last means nothing.
#if defined(__AVX2__)
POINTFAIR_INLINE __m128i product_in_four(const std::uint8_t* activations, const std::int8_t* weights) {
  static_assert(net::kChannels == 48);
  const auto wide = [](const auto* p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); };
  const auto half = [](const auto* p) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p)); };
  const __m256i first = _mm256_madd_epi16(_mm256_maddubs_epi16(wide(activations), wide(weights)), _mm256_set1_epi16(1));
  const __m128i last = _mm_madd_epi16(_mm_maddubs_epi16(half(activations + 32), half(weights + 32)), _mm_set1_epi16(1));
  return _mm_add_epi32(_mm_add_epi32(_mm256_castsi256_si128(first), _mm256_extracti128_si256(first, 1)), last);
}
POINTFAIR_INLINE void find_gates(const std::uint8_t* activations, const std::int8_t* weights, float* out) {
  static_assert(net::kGates == 3);
  const __m128i a = product_in_four(activations, weights), b = product_in_four(activations, weights + net::kChannels),
                c = product_in_four(activations, weights + 2 * net::kChannels);
  _mm_storeu_ps(out, _mm_cvtepi32_ps(_mm_hadd_epi32(_mm_hadd_epi32(a, b), _mm_hadd_epi32(c, c))));
}
#else
POINTFAIR_INLINE void find_gates(const std::uint8_t* activations, const std::int8_t* weights, float* out) {
  for (int g = 0; g < net::kGates; ++g) out[g] = static_cast<float>(product(activations, weights + g * net::kChannels));
}
#endif

}  // namespace pointfair::cpu::POINTFAIR_ISA
