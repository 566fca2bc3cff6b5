// SPDX-License-Identifier: Apache-2.0
// The activations of the net's channels, a row for each neighbour of a point. Part of src/cpu/net_kernels.cpp.
#pragma once

#include <cstdint>

#include "cpu/pack.h"
#include "point/net.h"

namespace pointfair::cpu::POINTFAIR_ISA {

namespace net = point::net;

inline constexpr int kRegisterBytes = 4 * kLanes;
typedef std::uint8_t Bytes __attribute__((vector_size(kRegisterBytes)));
typedef std::uint16_t BytePairs __attribute__((vector_size(kRegisterBytes)));
inline constexpr int kRowVectors = (net::kChannels + kRegisterBytes - 1) / kRegisterBytes;
inline constexpr int kRowBytes = kRowVectors * kRegisterBytes;

// In the registers' own order, of which channel_at() of the instruction set says the channels.
struct ActivationRow {
  Bytes of[kRowVectors];
};

// Mean, rounded, and largest of kNeighbors rows, which come in pairs.
class RowSummary {
 public:
  POINTFAIR_INLINE void add(const ActivationRow& a, const ActivationRow& b) {
    for (int v = 0; v < kRowVectors; ++v) {
      const BytePairs both = BytePairs(a.of[v] + b.of[v]);  // at most 254
      even_[v] += both & 255;
      odd_[v] += both >> 8;
      most_.of[v] = larger_of(most_.of[v], larger_of(a.of[v], b.of[v]));
    }
  }
  POINTFAIR_INLINE ActivationRow largest() const { return most_; }
  POINTFAIR_INLINE ActivationRow mean() const {
    static_assert(net::kNeighbors == 16);
    const auto mean_of = [](BytePairs sum) { return (sum + net::kNeighbors / 2) >> 4; };
    ActivationRow row;
    for (int v = 0; v < kRowVectors; ++v) row.of[v] = Bytes(mean_of(even_[v]) | mean_of(odd_[v]) << 8);
    return row;
  }

 private:
  // In intrinsics, since g++ 12 compares and chooses in place of one instruction.
  POINTFAIR_INLINE static Bytes larger_of(Bytes a, Bytes b) {
#if defined(__AVX512F__)
    return Bytes(_mm512_max_epu8(__m512i(a), __m512i(b)));
#elif defined(__AVX2__)
    return Bytes(_mm256_max_epu8(__m256i(a), __m256i(b)));
#elif defined(__SSE2__)
    return Bytes(_mm_max_epu8(__m128i(a), __m128i(b)));
#else
    return a > b ? a : b;
#endif
  }

  BytePairs even_[kRowVectors] = {}, odd_[kRowVectors] = {};
  ActivationRow most_ = {};
};

}  // namespace pointfair::cpu::POINTFAIR_ISA
