// SPDX-License-Identifier: Apache-2.0
// Position along a Hilbert curve of 1024 steps an axis, after J. Skilling, "Programming the Hilbert curve" (2004):
// consecutive positions are adjacent cells, so consecutive points make compact leaves, without the jumps of Morton
// order. Part of src/cpu/kernels.cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "cpu/pack.h"

namespace pointfair::cpu::POINTFAIR_ISA {

inline constexpr int kHilbertBits = 10;

// Bits 0..9 to bits 0, 3, .. 27.
POINTFAIR_INLINE IntVector spread_bits(IntVector v) {
  v = (v | (v << 16)) & 0x030000ff;
  v = (v | (v << 8)) & 0x0300f00f;
  v = (v | (v << 4)) & 0x030c30c3;
  return (v | (v << 2)) & 0x09249249;
}

POINTFAIR_INLINE IntVector hilbert_key(IntVector x, IntVector y, IntVector z) {
  for (int q = 1 << (kHilbertBits - 1); q > 1; q >>= 1) {
    const int p = q - 1;
    x = (x & q) != 0 ? x ^ p : x;
    const IntVector swap_y = (x ^ y) & p, y_set = (y & q) != 0;
    x = y_set ? x ^ p : x ^ swap_y;
    y = y_set ? y : y ^ swap_y;
    const IntVector swap_z = (x ^ z) & p, z_set = (z & q) != 0;
    x = z_set ? x ^ p : x ^ swap_z;
    z = z_set ? z : z ^ swap_z;
  }
  y ^= x;
  z ^= y;
  IntVector t{};
  for (int q = 1 << (kHilbertBits - 1); q > 1; q >>= 1) t = (z & q) != 0 ? t ^ (q - 1) : t;
  return (spread_bits(x ^ t) << 2) | (spread_bits(y ^ t) << 1) | spread_bits(z ^ t);
}

// The step of a coordinate, points outside the cube at its border.
POINTFAIR_INLINE IntVector hilbert_step(FloatVector coordinate, float origin, float scale) {
  FloatVector step = (coordinate - origin) * scale;
  step = step > 0.0f ? step : FloatVector{};
  const FloatVector top = FloatVector{} + float((1 << kHilbertBits) - 1);
  return __builtin_convertvector(step < top ? step : top, IntVector);
}

inline void hilbert_keys(const float* xyz, std::uint64_t* elements, std::size_t count, float x, float y, float z,
                         float scale) {
  for (std::size_t i = 0; i < count; i += kLanes) {
    FloatVector px{}, py{}, pz{};
    const int lanes = count - i < std::size_t(kLanes) ? int(count - i) : kLanes;
    for (int lane = 0; lane < lanes; ++lane) {
      const float* p = xyz + 3 * std::size_t(std::uint32_t(elements[i + lane]));
      px[lane] = p[0];
      py[lane] = p[1];
      pz[lane] = p[2];
    }
    const IntVector key =
        hilbert_key(hilbert_step(px, x, scale), hilbert_step(py, y, scale), hilbert_step(pz, z, scale));
    for (int lane = 0; lane < lanes; ++lane)
      elements[i + lane] = (std::uint64_t(std::uint32_t(key[lane])) << 32) | std::uint32_t(elements[i + lane]);
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
