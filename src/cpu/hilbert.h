// SPDX-License-Identifier: Apache-2.0
// Position along a Hilbert curve of 1024 steps an axis, after J. Skilling, "Programming the Hilbert curve" (2004):
// consecutive positions are adjacent cells, so consecutive points make compact leaves, without the jumps of Morton
// order. Part of src/cpu/kernels.cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "cpu/pack.h"
#include "point/curve.h"

namespace pointfair::cpu::POINTFAIR_ISA {

inline constexpr int kHilbertBits = 10;
static_assert(kHilbertBits == point::kDigitBits);

// Bits 0..9 to bits 0, 3, .. 27.
POINTFAIR_INLINE IntVector spread_bits(IntVector v) {
  v = (v | (v << 16)) & 0x030000ff;
  v = (v | (v << 8)) & 0x0300f00f;
  v = (v | (v << 4)) & 0x030c30c3;
  return (v | (v << 2)) & 0x09249249;
}

// All bits set where bit `bit` of v is; cheaper than comparison and mask.
POINTFAIR_INLINE IntVector spread_bit(IntVector v, int bit) { return (v << (31 - bit)) >> 31; }

inline constexpr int kPacks = 2;  // keyed side by side: one alone would wait for its own results most of the time

// Replaces x by the keys.
POINTFAIR_INLINE void hilbert_key(IntVector* x, IntVector* y, IntVector* z) {
#pragma GCC unroll 16
  for (int bit = kHilbertBits - 1; bit > 0; --bit) {
    const int p = (1 << bit) - 1;
#pragma GCC unroll 2
    for (int i = 0; i < kPacks; ++i) {
      x[i] ^= spread_bit(x[i], bit) & p;
      const IntVector y_set = spread_bit(y[i], bit), swap_y = (x[i] ^ y[i]) & p & ~y_set;
      x[i] ^= swap_y | (y_set & p);
      y[i] ^= swap_y;
      const IntVector z_set = spread_bit(z[i], bit), swap_z = (x[i] ^ z[i]) & p & ~z_set;
      x[i] ^= swap_z | (z_set & p);
      z[i] ^= swap_z;
    }
  }
#pragma GCC unroll 2
  for (int i = 0; i < kPacks; ++i) {
    y[i] ^= x[i];
    z[i] ^= y[i];
    IntVector t = z[i] >> 1;  // bit j: the exclusive or of all bits of z above j
    for (int shift = 1; shift < kHilbertBits; shift *= 2) t ^= t >> shift;
    x[i] = (spread_bits(x[i] ^ t) << 2) | (spread_bits(y[i] ^ t) << 1) | spread_bits(z[i] ^ t);
  }
}

// The step of a coordinate, points outside the cube at its border.
POINTFAIR_INLINE IntVector hilbert_step(FloatVector coordinate, float origin, float scale) {
  FloatVector step = (coordinate - origin) * scale;
  step = step > 0.0f ? step : FloatVector{};
  const FloatVector top = FloatVector{} + float((1 << kHilbertBits) - 1);
  return __builtin_convertvector(step < top ? step : top, IntVector);
}

// The coordinates of the points that `count` <= kLanes elements name, in ascending order or not.
POINTFAIR_INLINE point::Vec3<Floats> points_of(const float* xyz, const std::uint64_t* elements, int count,
                                               bool ascending) {
  const std::uint32_t first = std::uint32_t(elements[0]);
  if (ascending && count == kLanes && std::uint32_t(elements[kLanes - 1]) - first == kLanes - 1) {  // consecutive
    const float* p = xyz + 3 * std::size_t(first);
    const Ints offset = {lane_numbers().v * 3};
    return {gather(p, offset), gather(p + 1, offset), gather(p + 2, offset)};
  }
  float x[kLanes] = {}, y[kLanes] = {}, z[kLanes] = {};
  for (int lane = 0; lane < count; ++lane) {
    const float* p = xyz + 3 * std::size_t(std::uint32_t(elements[lane]));
    x[lane] = p[0];
    y[lane] = p[1];
    z[lane] = p[2];
  }
  return {load(x), load(y), load(z)};
}

// Writes the keys of steps(x, y, z), steps along each axis of a pack of points, into the high halves.
template <class Steps>
POINTFAIR_INLINE void key_elements(const float* xyz, std::uint64_t* elements, std::size_t count, bool ascending,
                                   Steps steps) {
  constexpr std::size_t kRound = kPacks * kLanes;
  for (std::size_t i = 0; i < count; i += kRound) {
    const int points = count - i < kRound ? int(count - i) : int(kRound);
    IntVector step_x[kPacks] = {}, step_y[kPacks] = {}, step_z[kPacks] = {};
    for (int pack = 0; pack * kLanes < points; ++pack) {
      const int rest = points - pack * kLanes;
      const point::Vec3<Ints> step =
          steps(points_of(xyz, elements + i + pack * kLanes, rest < kLanes ? rest : kLanes, ascending));
      step_x[pack] = step.x.v;
      step_y[pack] = step.y.v;
      step_z[pack] = step.z.v;
    }
    hilbert_key(step_x, step_y, step_z);
    unsigned key[kRound];
    for (int pack = 0; pack < kPacks; ++pack) store(key + pack * kLanes, Ints{step_x[pack]});
    for (int j = 0; j < points; ++j) elements[i + j] = (std::uint64_t(key[j]) << 32) | std::uint32_t(elements[i + j]);
  }
}

inline void hilbert_keys(const float* xyz, std::uint64_t* elements, std::size_t count, float x, float y, float z,
                         float scale) {
  key_elements(xyz, elements, count, true, [&](point::Vec3<Floats> p) -> point::Vec3<Ints> {
    return {{hilbert_step(p.x.v, x, scale)}, {hilbert_step(p.y.v, y, scale)}, {hilbert_step(p.z.v, z, scale)}};
  });
}

inline void curve_keys(const float* xyz, std::uint64_t* elements, std::size_t count, point::CurveCube cube,
                       bool second) {
  const auto digit = [&](Floats coordinate, float origin) -> Ints {
    const Floats step = point::curve_step(coordinate, origin, cube.inverse_side);
    const IntVector whole = __builtin_convertvector(step.v, IntVector);
    return {second ? whole & ((1 << point::kDigitBits) - 1) : whole >> point::kDigitBits};
  };
  key_elements(xyz, elements, count, !second, [&](point::Vec3<Floats> p) -> point::Vec3<Ints> {
    return {digit(p.x, cube.x), digit(p.y, cube.y), digit(p.z, cube.z)};
  });
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
