// SPDX-License-Identifier: Apache-2.0
// Position along a Hilbert curve, after J. Skilling, "Programming the Hilbert curve" (2004): consecutive positions are
// adjacent cells, so consecutive points make compact leaves, without the jumps of Morton order. His transformation
// reads the coordinates' bits from the highest down; what it does to the lower ones is a permutation of the axes and a
// reflection, so it is an automaton, here as a table that takes two bits of each axis at a time.
#pragma once

#include <cstdint>

#include "point/curve.h"

namespace pointfair::cuda {

struct HilbertTable {
  static constexpr int kStates = 48, kSteps = 64;
  // [state][2 bits of x, of y, of z]: 6 bits of position, and the next state above them
  alignas(16) std::uint16_t entry[kStates * kSteps] = {};
};

// What Skilling's loop has done to the bits that are still to be read: bit `axis[i]`, inverted where `mirrored[i]`, now
// stands for axis i; `gray` inverts all three at last.
struct HilbertState {
  int axis[3] = {0, 1, 2};
  bool mirrored[3] = {};
  bool gray = false;
  constexpr bool operator==(const HilbertState&) const = default;

  // Takes a bit of each axis, moves on, and returns 3 bits of position.
  constexpr unsigned step(const bool (&bits)[3]) {
    bool b[3] = {};
    for (int i = 0; i < 3; ++i) b[i] = bits[axis[i]] != mirrored[i];
    if (b[0]) mirrored[0] = !mirrored[0];
    for (int i = 1; i < 3; ++i) {
      if (b[i]) {
        mirrored[0] = !mirrored[0];
      } else {
        const int a = axis[0];
        const bool m = mirrored[0];
        axis[0] = axis[i], mirrored[0] = mirrored[i];
        axis[i] = a, mirrored[i] = m;
      }
    }
    const bool x = b[0], y = b[1] != x, z = b[2] != y, g = gray;
    gray = g != z;
    return (x != g ? 4u : 0u) + (y != g ? 2u : 0u) + (z != g ? 1u : 0u);
  }
};

constexpr HilbertTable make_hilbert_table() {
  HilbertTable table;
  HilbertState states[HilbertTable::kStates];
  int known = 1;
  for (int s = 0; s < known; ++s) {
    for (unsigned two = 0; two < HilbertTable::kSteps; ++two) {
      HilbertState state = states[s];
      unsigned position = 0;
      for (int level = 1; level >= 0; --level) {
        const bool bits[3] = {(two >> (4 + level) & 1u) != 0, (two >> (2 + level) & 1u) != 0, (two >> level & 1u) != 0};
        position = position * 8 + state.step(bits);
      }
      int next = 0;
      while (next < known && !(states[next] == state)) ++next;
      if (next == known) states[known++] = state;
      table.entry[s * HilbertTable::kSteps + static_cast<int>(two)] =
          static_cast<std::uint16_t>(position | static_cast<unsigned>(next) << 6);
    }
  }
  return table;
}
__device__ constexpr HilbertTable kHilbertTable = make_hilbert_table();

// `entry`: the table, best in shared memory. Of an odd number of bits the first step's upper ones are zeros, which
// leave position 0.
template <class Key, int kBits>
__device__ __forceinline__ Key hilbert_key(const std::uint16_t* entry, unsigned x, unsigned y, unsigned z) {
  Key key = 0;
  unsigned state = 0;
#pragma unroll
  for (int bit = (kBits - 1) / 2 * 2; bit >= 0; bit -= 2) {
    const unsigned step = (x >> bit & 3u) << 4 | (y >> bit & 3u) << 2 | (z >> bit & 3u);
    const unsigned found = entry[state * HilbertTable::kSteps + step];
    key = key << 6 | (found & 63u);
    state = found >> 6;
  }
  return key;
}

// Of the curve of src/point/curve.h.
template <class Key>
__device__ __forceinline__ Key curve_key(const std::uint16_t* entry, point::Vec3<float> p, point::CurveCube cube) {
  const unsigned x = static_cast<unsigned>(point::curve_step(p.x, cube.x, cube.inverse_side)),
                 y = static_cast<unsigned>(point::curve_step(p.y, cube.y, cube.inverse_side)),
                 z = static_cast<unsigned>(point::curve_step(p.z, cube.z, cube.inverse_side));
  constexpr int kDigit = point::kDigitBits;
  constexpr unsigned kMask = (1u << kDigit) - 1;
  const Key first = hilbert_key<Key, kDigit>(entry, x >> kDigit, y >> kDigit, z >> kDigit);
  return first << (3 * kDigit) | hilbert_key<Key, kDigit>(entry, x & kMask, y & kMask, z & kMask);
}

}  // namespace pointfair::cuda
