// SPDX-License-Identifier: Apache-2.0
// Whole numbers of the net in registers of 128 bits, with vectors as compilers know them (src/cpu/net_arithmetic.h says
// what each is). Only the product of bytes has instructions of its own.
#pragma once

#include <array>
#include <cstdint>

#include "cpu/net_rows.h"

namespace pointfair::cpu::POINTFAIR_ISA {

typedef int SumVector __attribute__((vector_size(16)));
typedef std::int16_t StoredVector __attribute__((vector_size(8)));
typedef std::uint8_t FourBytes __attribute__((vector_size(4)));
typedef std::int8_t SignedBytes __attribute__((vector_size(16)));
inline constexpr int kVectors = net::kChannels / kLanes;
static_assert(net::kChannels % kRegisterBytes == 0);

template <class To>
POINTFAIR_INLINE To loaded(const void* p) {
  To result;
  __builtin_memcpy(&result, p, sizeof result);
  return result;
}
POINTFAIR_INLINE SumVector load_sums(const int* p) { return loaded<SumVector>(p); }
POINTFAIR_INLINE SumVector load_words(const std::int8_t* p) { return loaded<SumVector>(p); }
POINTFAIR_INLINE SumVector broadcast_word(int word) { return SumVector{word, word, word, word}; }
POINTFAIR_INLINE SumVector sum_of(SumVector a, SumVector b) { return a + b; }

// `inputs` are at most 127 and not negative.
POINTFAIR_INLINE SumVector add_word(SumVector sum, SumVector inputs, SumVector weights) {
#if defined(__SSE2__)
  const __m128i a = __m128i(inputs), w = __m128i(weights), zero = _mm_setzero_si128();
  const auto products = [](__m128i x, __m128i twice) { return _mm_madd_epi16(x, _mm_srai_epi16(twice, 8)); };
  const __m128 low = _mm_castsi128_ps(products(_mm_unpacklo_epi8(a, zero), _mm_unpacklo_epi8(w, w)));
  const __m128 high = _mm_castsi128_ps(products(_mm_unpackhi_epi8(a, zero), _mm_unpackhi_epi8(w, w)));
  return sum + SumVector(_mm_shuffle_ps(low, high, 0x88)) + SumVector(_mm_shuffle_ps(low, high, 0xdd));
#elif defined(__aarch64__)
  const int8x16_t a = int8x16_t(inputs), w = int8x16_t(weights);
  const int16x8_t low = vmull_s8(vget_low_s8(a), vget_low_s8(w)), high = vmull_high_s8(a, w);
  return SumVector(vpadalq_s16(int32x4_t(sum), vpaddq_s16(low, high)));
#else
  const SignedBytes a = SignedBytes(inputs), w = SignedBytes(weights);
  for (int i = 0; i < 16; ++i) sum[i / 4] += a[i] * w[i];
  return sum;
#endif
}

POINTFAIR_INLINE SumVector clamped(SumVector value, int least, int most) {
  const SumVector low = SumVector{} + least, high = SumVector{} + most;
  value = value < low ? low : value;
  return value > high ? high : value;
}
POINTFAIR_INLINE void add_stored(const SumVector* own, const std::int16_t* stored, SumVector* sums) {
  for (int v = 0; v < kVectors; ++v)
    sums[v] = own[v] +
              __builtin_convertvector(loaded<StoredVector>(stored + v * kLanes), SumVector) * (1 << net::kStoredShift);
}
POINTFAIR_INLINE void store_for_neighbors(const SumVector* sums, std::int16_t* out) {
  for (int v = 0; v < kVectors; ++v) {
    const auto narrow = __builtin_convertvector(clamped(sums[v] >> net::kStoredShift, -32768, 32767), StoredVector);
    __builtin_memcpy(out + v * kLanes, &narrow, sizeof narrow);
  }
}

// In the order of the channels.
constexpr int channel_at(int byte) { return byte; }
POINTFAIR_INLINE ActivationRow activations_of(const SumVector* sums) {
  ActivationRow row;
#if defined(__SSE2__)
  for (int v = 0; v < kRowVectors; ++v) {
    const auto pair = [&](int at) {
      return _mm_srai_epi16(_mm_packs_epi32(__m128i(sums[at]), __m128i(sums[at + 1])), net::kSumShift);
    };
    row.of[v] = Bytes(_mm_min_epu8(_mm_packus_epi16(pair(4 * v), pair(4 * v + 2)), _mm_set1_epi8(127)));
  }
#else
  for (int v = 0; v < kVectors; ++v) {
    const auto bytes = __builtin_convertvector(clamped(sums[v] >> net::kSumShift, 0, 127), FourBytes);
    __builtin_memcpy(reinterpret_cast<std::uint8_t*>(row.of) + v * kLanes, &bytes, sizeof bytes);
  }
#endif
  return row;
}
POINTFAIR_INLINE void store_row(const ActivationRow& row, std::uint8_t* out) {
  __builtin_memcpy(out, row.of, sizeof row.of);
}

// The sums of the lanes of 4 vectors.
POINTFAIR_INLINE SumVector sums_of_lanes(const SumVector* of) {
  const auto sum = [&](int v) { return of[v][0] + of[v][1] + of[v][2] + of[v][3]; };
  return SumVector{sum(0), sum(1), sum(2), sum(3)};
}
POINTFAIR_INLINE Floats floats_of(SumVector sums) { return Floats(__builtin_convertvector(sums, FloatVector)); }

// Four numbers of each of kLanes rows of floats, number by number; from(lane) is where those of a row begin.
template <class From>
POINTFAIR_INLINE std::array<Floats, 4> four_columns(const From& from) {
  static_assert(kLanes == 4);
#if defined(__SSE2__)
  __m128 a = _mm_loadu_ps(from(0)), b = _mm_loadu_ps(from(1)), c = _mm_loadu_ps(from(2)), d = _mm_loadu_ps(from(3));
  _MM_TRANSPOSE4_PS(a, b, c, d);
  return {Floats(FloatVector(a)), Floats(FloatVector(b)), Floats(FloatVector(c)), Floats(FloatVector(d))};
#else
  std::array<Floats, 4> columns;
  for (int lane = 0; lane < kLanes; ++lane)
    for (std::size_t i = 0; i < 4; ++i) columns[i].v[lane] = from(lane)[i];
  return columns;
#endif
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
