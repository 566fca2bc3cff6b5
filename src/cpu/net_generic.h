// SPDX-License-Identifier: Apache-2.0
// Whole numbers of the net where no instructions for products of bytes are used (src/cpu/net_arithmetic.h says what
// each is).
#pragma once

#include <array>
#include <cstdint>

#include "cpu/pack.h"
#include "point/net.h"

namespace pointfair::cpu::POINTFAIR_ISA {

namespace net = point::net;

inline constexpr int kSumLanes = 4;
struct SumVector {
  int v[4];
};
struct WordVector {
  const std::int8_t* of;
};
POINTFAIR_INLINE SumVector load_sums(const int* p) { return {{p[0], p[1], p[2], p[3]}}; }
POINTFAIR_INLINE WordVector load_words(const std::int8_t* p) { return {p}; }
POINTFAIR_INLINE int broadcast_word(int word) { return word; }
POINTFAIR_INLINE SumVector sum_of(SumVector a, SumVector b) {
  for (int lane = 0; lane < 4; ++lane) a.v[lane] += b.v[lane];
  return a;
}
POINTFAIR_INLINE SumVector add_word(SumVector sum, int word, WordVector weights) {
  for (int lane = 0; lane < 4; ++lane)
    for (int byte = 0; byte < 4; ++byte) sum.v[lane] += (word >> 8 * byte & 127) * weights.of[4 * lane + byte];
  return sum;
}

POINTFAIR_INLINE void add_stored(const SumVector* own, const std::int16_t* stored, SumVector* sums) {
  for (int c = 0; c < net::kChannels; ++c)
    sums[c / 4].v[c % 4] = own[c / 4].v[c % 4] + stored[c] * (1 << net::kStoredShift);
}
POINTFAIR_INLINE void store_for_neighbors(const SumVector* sums, std::int16_t* out) {
  for (int c = 0; c < net::kChannels; ++c) {
    const int value = sums[c / 4].v[c % 4] >> net::kStoredShift;
    out[c] = static_cast<std::int16_t>(value < -32768 ? -32768 : value > 32767 ? 32767 : value);
  }
}

struct RowOfBytes {
  std::uint8_t of[net::kChannels];
};
using ActivationRow = RowOfBytes;
inline constexpr int kRowBytes = net::kChannels;
constexpr int channel_at(int byte) { return byte; }
POINTFAIR_INLINE ActivationRow activations_of(const SumVector* sums) {
  ActivationRow row;
  for (int c = 0; c < net::kChannels; ++c) {
    const int value = sums[c / 4].v[c % 4] >> net::kSumShift;
    row.of[c] = static_cast<std::uint8_t>(value < 0 ? 0 : value > 127 ? 127 : value);
  }
  return row;
}
POINTFAIR_INLINE void store_row(const ActivationRow& row, std::uint8_t* out) {
  __builtin_memcpy(out, row.of, sizeof row.of);
}

class SummaryOfBytes {
 public:
  POINTFAIR_INLINE void add(const ActivationRow& a, const ActivationRow& b) {
    for (int c = 0; c < net::kChannels; ++c) {
      sum_[c] = static_cast<std::uint16_t>(sum_[c] + a.of[c] + b.of[c]);
      const std::uint8_t larger = a.of[c] > b.of[c] ? a.of[c] : b.of[c];
      most_.of[c] = larger > most_.of[c] ? larger : most_.of[c];
    }
  }
  POINTFAIR_INLINE ActivationRow largest() const { return most_; }
  POINTFAIR_INLINE ActivationRow mean() const {
    ActivationRow row;
    for (int c = 0; c < net::kChannels; ++c)
      row.of[c] = static_cast<std::uint8_t>((sum_[c] + net::kNeighbors / 2) / net::kNeighbors);
    return row;
  }

 private:
  std::uint16_t sum_[net::kChannels] = {};
  ActivationRow most_ = {};
};
using RowSummary = SummaryOfBytes;

POINTFAIR_INLINE void find_gate(const ActivationRow* rows, const std::int8_t* weights, float* out) {
  for (int e = 0; e < net::kNeighbors; ++e) {
    int sum = 0;
    for (int c = 0; c < net::kChannels; ++c) sum += rows[e].of[c] * weights[c];
    out[e] = static_cast<float>(sum);
  }
}

template <class From>
POINTFAIR_INLINE std::array<Floats, 4> four_columns(const From& from) {
  float columns[4][kLanes];
  for (int lane = 0; lane < kLanes; ++lane)
    for (int i = 0; i < 4; ++i) columns[i][lane] = from(lane)[i];
  return {{load(columns[0]), load(columns[1]), load(columns[2]), load(columns[3])}};
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
