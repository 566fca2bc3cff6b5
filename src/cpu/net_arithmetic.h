// SPDX-License-Identifier: Apache-2.0
// Products of whole numbers as the net of method learned needs them. Activations are at most 127 and weights at least
// -127, so two products fit into 16 bits and no instruction saturates: all variants give the same numbers. Part of
// src/cpu/net_kernels.cpp.
//
// Each instruction set has: a SumVector of kSumLanes sums of channels side by side, load_sums() and sum_of() of them;
// load_words(), the weights of one word of inputs for as many channels, and add_word(), which adds their products with
// that word in every lane; store_for_neighbors(), what is kept of a row of sums, in an order of its own, and
// add_stored(), which adds it to another row; an ActivationRow, the activations of a row of sums in the registers'
// order, of which channel_at() says the channels, -1 where a byte counts for nothing, and store_row() brings them into
// order; a RowSummary, the mean and the largest of kNeighbors rows that come two by two; find_gate(), of each row its
// sum of products with weights in its order; four_columns(), four numbers of each of kLanes rows of floats, number by
// number, where from(lane) is the first of them. Sums have the rounding of what comes after in them.
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
inline constexpr int kSumVectors = net::kChannels / kSumLanes;

// The sums of one point as vectors.
struct SumRow {
  SumVector of[kSumVectors];

  // From `bias`, null for 0, with the rounding of what comes after.
  POINTFAIR_INLINE SumRow(const int* bias, int rounding) {
    alignas(64) int from[net::kChannels];
    for (int c = 0; c < net::kChannels; ++c) from[c] = (bias != nullptr ? bias[c] : 0) + rounding;
    for (int v = 0; v < kSumVectors; ++v) of[v] = load_sums(from + v * kSumLanes);
  }
  // Adds weights x inputs, which are `count` bytes, a multiple of 4.
  POINTFAIR_INLINE void add_products(const std::uint8_t* inputs, int count, const std::int8_t* weights) {
    for (int i = 0; i < count; i += 4, weights += 4 * net::kChannels) {
      int word;
      __builtin_memcpy(&word, inputs + i, sizeof word);
      const auto all = broadcast_word(word);
      for (int v = 0; v < kSumVectors; ++v) of[v] = add_word(of[v], all, load_words(weights + 4 * v * kSumLanes));
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
    for (int i = 0; i < net::kEdgeWords * kSumVectors; ++i) of_[i] = load_words(weights + 4 * i * kSumLanes);
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
  decltype(load_words(nullptr)) of_[net::kEdgeWords * kSumVectors];
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

// One row of weights times activations.
POINTFAIR_INLINE int product(const std::uint8_t* activations, const std::int8_t* weights) {
  int sum = 0;
  for (int c = 0; c < net::kChannels; ++c) sum += activations[c] * weights[c];
  return sum;
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
