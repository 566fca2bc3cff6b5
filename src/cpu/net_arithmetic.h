// SPDX-License-Identifier: Apache-2.0
// Products of whole numbers as the net of method learned needs them. Activations are at most 127 and weights at least
// -127, so two products fit into 16 bits and no instruction saturates: all variants give the same numbers. Part of
// src/cpu/net_kernels.cpp.
//
// Each instruction set has: a SumVector of kLanes sums of channels side by side, load_sums() and sum_of() of them;
// load_words(), the weights of one word of inputs for as many channels, and add_word(), which adds their products with
// that word in every lane; store_for_neighbors(), what is kept of a row of sums, in an order of its own, and
// add_stored(), which adds it to another row; activations_of() a row of sums, channel_at(), the channel of a byte of
// such a row, -1 where it counts for nothing, and store_row(), which brings one into order; sums_of_lanes() of kLanes
// vectors, and floats_of() them; four_columns(), four numbers of each of kLanes rows of floats, number by number, where
// from(lane) is the first of them. Sums have the rounding of what comes after in them.
#pragma once

#if defined(__AVX512F__)
#include "cpu/net_avx512.h"
#elif defined(__AVX2__)
#include "cpu/net_avx2.h"
#else
#include "cpu/net_generic.h"
#endif

namespace pointfair::cpu::POINTFAIR_ISA {

POINTFAIR_INLINE Ints operator+(Ints a, Ints b) { return {a.v + b.v}; }
POINTFAIR_INLINE Ints operator<<(Ints a, int bits) { return {IntVector(UnsignedVector(a.v) << unsigned(bits))}; }

inline constexpr int kRounding = 1 << (net::kSumShift - 1), kStoredRounding = 1 << (net::kStoredShift - 1);
inline constexpr int kSumVectors = net::kChannels / kLanes;

// The sums of one point as vectors.
struct SumRow {
  SumVector of[kSumVectors];

  // From `bias`, null for 0, with the rounding of what comes after.
  POINTFAIR_INLINE SumRow(const int* bias, int rounding) {
    alignas(64) int from[net::kChannels];
    for (int c = 0; c < net::kChannels; ++c) from[c] = (bias != nullptr ? bias[c] : 0) + rounding;
    for (int v = 0; v < kSumVectors; ++v) of[v] = load_sums(from + v * kLanes);
  }
  // Adds weights x inputs, which are `count` bytes, a multiple of 4.
  POINTFAIR_INLINE void add_products(const std::uint8_t* inputs, int count, const std::int8_t* weights) {
    for (int i = 0; i < count; i += 4, weights += 4 * net::kChannels) {
      int word;
      __builtin_memcpy(&word, inputs + i, sizeof word);
      const auto all = broadcast_word(word);
      for (int v = 0; v < kSumVectors; ++v) of[v] = add_word(of[v], all, load_words(weights + 4 * v * kLanes));
    }
  }
  POINTFAIR_INLINE void add(const SumRow& other) {
    for (int v = 0; v < kSumVectors; ++v) of[v] = sum_of(of[v], other.of[v]);
  }
};

// The weights of an edge's features, in registers where there are enough.
class EdgeWeights {
 public:
  POINTFAIR_INLINE explicit EdgeWeights(const std::int8_t* weights) {
    for (int i = 0; i < net::kEdgeWords * kSumVectors; ++i) of_[i] = load_words(weights + 4 * i * kLanes);
  }
  // What an edge makes of the point's own part, of its neighbour's and of its features.
  POINTFAIR_INLINE ActivationRow activations(const SumRow& own, const std::int16_t* there, const int* words) const {
    SumVector sums[kSumVectors];
    add_stored(own.of, there, sums);
    for (int w = 0; w < net::kEdgeWords; ++w) {
      const auto all = broadcast_word(words[w]);
      for (int v = 0; v < kSumVectors; ++v) sums[v] = add_word(sums[v], all, of_[w * kSumVectors + v]);
    }
    return activations_of(sums);
  }

 private:
  SumVector of_[net::kEdgeWords * kSumVectors];
};

// The weights of gates in the order of rows.
struct GateWeights {
  alignas(64) std::int8_t of[net::kGates][kRowBytes];

  explicit GateWeights(const std::int8_t* rows) {
    for (int gate = 0; gate < net::kGates; ++gate)
      for (int byte = 0; byte < kRowBytes; ++byte)
        of[gate][byte] = channel_at(byte) < 0 ? std::int8_t{0} : rows[gate * net::kChannels + channel_at(byte)];
  }
};

// Of every row its products with the weights of one gate.
POINTFAIR_INLINE void find_gate(const ActivationRow* rows, const std::int8_t* weights, float* out) {
  for (int first = 0; first < net::kNeighbors; first += kLanes) {
    SumVector products[kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      products[lane] = broadcast_word(0);
      for (int v = 0; v < kRowVectors; ++v)
        products[lane] =
            add_word(products[lane], SumVector(rows[first + lane].of[v]), load_words(weights + v * kRegisterBytes));
    }
    store(out + first, floats_of(sums_of_lanes(products)));
  }
}

// One row of weights times activations.
POINTFAIR_INLINE int product(const std::uint8_t* activations, const std::int8_t* weights) {
  int sum = 0;
  for (int c = 0; c < net::kChannels; ++c) sum += activations[c] * weights[c];
  return sum;
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
