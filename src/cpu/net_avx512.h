// SPDX-License-Identifier: Apache-2.0
// Whole numbers of the net in registers of 512 bits (src/cpu/net_arithmetic.h says what each is).
#pragma once

#include <array>
#include <cstdint>

#include "cpu/net_rows.h"

namespace pointfair::cpu::POINTFAIR_ISA {

using SumVector = __m512i;
static_assert(net::kChannels == 3 * kLanes && net::kNeighbors == kLanes && net::kGates == 3);

POINTFAIR_INLINE SumVector load_sums(const int* p) { return _mm512_loadu_si512(p); }
POINTFAIR_INLINE SumVector load_words(const std::int8_t* p) { return _mm512_loadu_si512(p); }
POINTFAIR_INLINE SumVector broadcast_word(int word) { return _mm512_set1_epi32(word); }
POINTFAIR_INLINE SumVector sum_of(SumVector a, SumVector b) { return _mm512_add_epi32(a, b); }
POINTFAIR_INLINE SumVector add_word(SumVector sum, SumVector word, SumVector weights) {
#if defined(__AVX512VNNI__)
  return _mm512_dpbusd_epi32(sum, word, weights);
#else
  return _mm512_add_epi32(sum, _mm512_madd_epi16(_mm512_maddubs_epi16(word, weights), _mm512_set1_epi16(1)));
#endif
}
// `factors` of the two numbers in each 32 bits.
POINTFAIR_INLINE SumVector add_pairs(SumVector sum, __m512i pairs, int factors) {
#if defined(__AVX512VNNI__)
  return _mm512_dpwssd_epi32(sum, pairs, _mm512_set1_epi32(factors));
#else
  return _mm512_add_epi32(sum, _mm512_madd_epi16(pairs, _mm512_set1_epi32(factors)));
#endif
}

// Pairs of channels c and c + 16 of the first 32, then the other 16.
POINTFAIR_INLINE void add_stored(const SumVector* own, const std::int16_t* stored, SumVector* sums) {
  constexpr int kFirst = 1 << net::kStoredShift, kSecond = kFirst << 16;
  const __m512i pairs = _mm512_loadu_si512(stored);
  const __m512i last = _mm512_cvtepi16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(stored + 32)));
  sums[0] = add_pairs(own[0], pairs, kFirst);
  sums[1] = add_pairs(own[1], pairs, kSecond);
  sums[2] = add_pairs(own[2], last, kFirst);
}
POINTFAIR_INLINE void store_for_neighbors(const SumVector* sums, std::int16_t* out) {
  const auto narrow = [&](int v) { return _mm512_cvtsepi32_epi16(_mm512_srai_epi32(sums[v], net::kStoredShift)); };
  const __m512i first = _mm512_cvtepu16_epi32(narrow(0)), second = _mm512_cvtepu16_epi32(narrow(1));
  _mm512_storeu_si512(out, _mm512_or_si512(first, _mm512_slli_epi32(second, 16)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + 32), narrow(2));
}

// In each 128 bits, four channels of each of the three sums, and those of the last once more.
constexpr int channel_at(int byte) {
  const int sum = byte / 4 % 4;
  return sum == 3 ? -1 : kLanes * sum + byte / 16 * 4 + byte % 4;
}
POINTFAIR_INLINE ActivationRow activations_of(const SumVector* sums) {
  const __m512i first = _mm512_srai_epi16(_mm512_packs_epi32(sums[0], sums[1]), net::kSumShift);
  const __m512i last = _mm512_srai_epi16(_mm512_packs_epi32(sums[2], sums[2]), net::kSumShift);
  return {{Bytes(_mm512_min_epu8(_mm512_packus_epi16(first, last), _mm512_set1_epi8(127)))}};
}
// In the order of the channels.
POINTFAIR_INLINE void store_row(const ActivationRow& row, std::uint8_t* out) {
  const __m512i order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
  const __m512i all = _mm512_permutexvar_epi32(order, __m512i(row.of[0]));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm512_castsi512_si256(all));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out + 32), _mm512_extracti32x4_epi32(all, 2));
}

// The sums of the lanes of 16 vectors.
POINTFAIR_INLINE SumVector sums_of_lanes(const SumVector* of) {
  SumVector fours[4];
  for (int i = 0; i < 4; ++i) {
    const SumVector* const v = of + 4 * i;
    const auto pairs = [](SumVector a, SumVector b) {
      return _mm512_add_epi32(_mm512_unpacklo_epi32(a, b), _mm512_unpackhi_epi32(a, b));
    };
    const SumVector a = pairs(v[0], v[1]), b = pairs(v[2], v[3]);
    fours[i] = _mm512_add_epi32(_mm512_unpacklo_epi64(a, b), _mm512_unpackhi_epi64(a, b));
  }
  const auto quarters = [](SumVector a, SumVector b) {
    return _mm512_add_epi32(_mm512_shuffle_i32x4(a, b, 0x88), _mm512_shuffle_i32x4(a, b, 0xdd));
  };
  return quarters(quarters(fours[0], fours[1]), quarters(fours[2], fours[3]));
}
POINTFAIR_INLINE Floats floats_of(SumVector sums) { return Floats(FloatVector(_mm512_cvtepi32_ps(sums))); }

template <class From>
POINTFAIR_INLINE std::array<Floats, 4> four_columns(const From& from) {
  const auto row = [&](int k) {
    __m512 v = _mm512_castps128_ps512(_mm_loadu_ps(from(k)));
    v = _mm512_insertf32x4(v, _mm_loadu_ps(from(4 + k)), 1);
    v = _mm512_insertf32x4(v, _mm_loadu_ps(from(8 + k)), 2);
    return _mm512_insertf32x4(v, _mm_loadu_ps(from(12 + k)), 3);
  };
  const __m512 a = row(0), b = row(1), c = row(2), d = row(3);
  const __m512d low = _mm512_castps_pd(_mm512_unpacklo_ps(a, b)), low2 = _mm512_castps_pd(_mm512_unpacklo_ps(c, d));
  const __m512d high = _mm512_castps_pd(_mm512_unpackhi_ps(a, b)), high2 = _mm512_castps_pd(_mm512_unpackhi_ps(c, d));
  const auto floats = [](__m512d v) { return Floats(FloatVector(_mm512_castpd_ps(v))); };
  return {{floats(_mm512_unpacklo_pd(low, low2)), floats(_mm512_unpackhi_pd(low, low2)),
           floats(_mm512_unpacklo_pd(high, high2)), floats(_mm512_unpackhi_pd(high, high2))}};
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
