// SPDX-License-Identifier: Apache-2.0
// Whole numbers of the net in registers of 256 bits (src/cpu/net_arithmetic.h says what each is).
#pragma once

#include <array>
#include <cstdint>

#include "cpu/net_rows.h"

namespace pointfair::cpu::POINTFAIR_ISA {

using SumVector = __m256i;
static_assert(net::kChannels == 6 * kLanes && net::kNeighbors == 2 * kLanes && net::kGates == 3);

POINTFAIR_INLINE __m256i load_wide(const void* p) { return _mm256_loadu_si256(static_cast<const __m256i*>(p)); }
POINTFAIR_INLINE SumVector load_sums(const int* p) { return load_wide(p); }
POINTFAIR_INLINE SumVector load_words(const std::int8_t* p) { return load_wide(p); }
POINTFAIR_INLINE SumVector broadcast_word(int word) { return _mm256_set1_epi32(word); }
POINTFAIR_INLINE SumVector sum_of(SumVector a, SumVector b) { return _mm256_add_epi32(a, b); }
POINTFAIR_INLINE SumVector add_word(SumVector sum, SumVector word, SumVector weights) {
#if defined(__AVXVNNI__)
  return _mm256_dpbusd_avx_epi32(sum, word, weights);
#else
  return _mm256_add_epi32(sum, _mm256_madd_epi16(_mm256_maddubs_epi16(word, weights), _mm256_set1_epi16(1)));
#endif
}
// `factors` of the two numbers in each 32 bits.
POINTFAIR_INLINE SumVector add_pairs(SumVector sum, __m256i pairs, int factors) {
#if defined(__AVXVNNI__)
  return _mm256_dpwssd_avx_epi32(sum, pairs, _mm256_set1_epi32(factors));
#else
  return _mm256_add_epi32(sum, _mm256_madd_epi16(pairs, _mm256_set1_epi32(factors)));
#endif
}

// Three times pairs of channels c and c + 8 of 16.
POINTFAIR_INLINE void add_stored(const SumVector* own, const std::int16_t* stored, SumVector* sums) {
  constexpr int kFirst = 1 << net::kStoredShift, kSecond = kFirst << 16;
  for (int v = 0; v < 6; v += 2) {
    const __m256i pairs = load_wide(stored + v * kLanes);
    sums[v] = add_pairs(own[v], pairs, kFirst);
    sums[v + 1] = add_pairs(own[v + 1], pairs, kSecond);
  }
}
POINTFAIR_INLINE void store_for_neighbors(const SumVector* sums, std::int16_t* out) {
  const auto narrow = [&](int v) {
    const __m256i kept = _mm256_srai_epi32(sums[v], net::kStoredShift);
    return _mm256_max_epi32(_mm256_min_epi32(kept, _mm256_set1_epi32(32767)), _mm256_set1_epi32(-32768));
  };
  for (int v = 0; v < 6; v += 2) {
    const __m256i pairs = _mm256_blend_epi16(narrow(v), _mm256_slli_epi32(narrow(v + 1), 16), 0xaa);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + v * kLanes), pairs);
  }
}

// In each 128 bits, four channels of each of four sums; then of the last two, twice.
constexpr int channel_at(int byte) {
  const int sum = byte / 32 * 4 + byte / 4 % 4;
  return sum >= 6 ? -1 : kLanes * sum + byte % 32 / 16 * 4 + byte % 4;
}
POINTFAIR_INLINE ActivationRow activations_of(const SumVector* sums) {
  const auto packed = [&](int v) {
    return _mm256_srai_epi16(_mm256_packs_epi32(sums[v], sums[v + 1]), net::kSumShift);
  };
  const __m256i most = _mm256_set1_epi8(127), last = packed(4);
  return {{Bytes(_mm256_min_epu8(_mm256_packus_epi16(packed(0), packed(2)), most)),
           Bytes(_mm256_min_epu8(_mm256_packus_epi16(last, last), most))}};
}
// In the order of the channels.
POINTFAIR_INLINE void store_row(const ActivationRow& row, std::uint8_t* out) {
  const __m256i order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
  const __m256i last = _mm256_permutevar8x32_epi32(__m256i(row.of[1]), order);
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_permutevar8x32_epi32(__m256i(row.of[0]), order));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(out + 32), _mm256_castsi256_si128(last));
}

// The sums of the lanes of 8 vectors.
POINTFAIR_INLINE SumVector sums_of_lanes(const SumVector* of) {
  const auto four = [](const SumVector* v) {
    return _mm256_hadd_epi32(_mm256_hadd_epi32(v[0], v[1]), _mm256_hadd_epi32(v[2], v[3]));
  };
  const SumVector a = four(of), b = four(of + 4);
  return _mm256_add_epi32(_mm256_permute2x128_si256(a, b, 0x20), _mm256_permute2x128_si256(a, b, 0x31));
}
POINTFAIR_INLINE Floats floats_of(SumVector sums) { return Floats(FloatVector(_mm256_cvtepi32_ps(sums))); }

template <class From>
POINTFAIR_INLINE std::array<Floats, 4> four_columns(const From& from) {
  const auto row = [&](int k) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(from(k))), _mm_loadu_ps(from(4 + k)), 1);
  };
  const __m256 a = row(0), b = row(1), c = row(2), d = row(3);
  const __m256d low = _mm256_castps_pd(_mm256_unpacklo_ps(a, b)), low2 = _mm256_castps_pd(_mm256_unpacklo_ps(c, d));
  const __m256d high = _mm256_castps_pd(_mm256_unpackhi_ps(a, b)), high2 = _mm256_castps_pd(_mm256_unpackhi_ps(c, d));
  const auto floats = [](__m256d v) { return Floats(FloatVector(_mm256_castpd_ps(v))); };
  return {{floats(_mm256_unpacklo_pd(low, low2)), floats(_mm256_unpackhi_pd(low, low2)),
           floats(_mm256_unpacklo_pd(high, high2)), floats(_mm256_unpackhi_pd(high, high2))}};
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
