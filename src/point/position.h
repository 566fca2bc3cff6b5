// SPDX-License-Identifier: Apache-2.0
// Numbers made of where a point is. What is chosen by them depends on the set of points alone, not on their order; and
// since positions are taken relative to a corner of their cloud, an exact translation of the cloud changes nothing.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

POINTFAIR_INLINE unsigned long long bits_of(double x) {
  union {
    double f;
    unsigned long long u;
  } bits = {x + 0.0};  // zero has one sign
  return bits.u;
}

// Scatters three numbers over 2^32; each word and the whole after the finaliser of the 64-bit MurmurHash3 (A. Appleby).
POINTFAIR_INLINE unsigned scattered(double x, double y, double z) {
  unsigned long long hash = 0x9e3779b97f4a7c15ull;
  const unsigned long long words[3] = {bits_of(x), bits_of(y), bits_of(z)};
  for (int i = 0; i < 3; ++i) {
    hash = (hash ^ words[i]) * 0xff51afd7ed558ccdull;
    hash ^= hash >> 33;
  }
  hash *= 0xc4ceb9fe1a85ec53ull;
  return static_cast<unsigned>(hash >> 32);
}

// The difference of two floats is, but for extremes, a double.
POINTFAIR_INLINE Vec3<double> exact_offset(Vec3<float> p, Vec3<float> from) {
  return {double(p.x) - double(from.x), double(p.y) - double(from.y), double(p.z) - double(from.z)};
}

POINTFAIR_INLINE unsigned position_hash(Vec3<float> p, Vec3<float> corner) {
  const Vec3<double> d = exact_offset(p, corner);
  return scattered(d.x, d.y, d.z);
}
// Over [0, 1).
POINTFAIR_INLINE float share_of_hash(unsigned hash) { return static_cast<float>(hash >> 8) * 5.9604644775390625e-8f; }

// Of the cell around a position: a cloud that was rounded anew keeps the cells of nearly all points, and with them what
// is chosen by cells.
POINTFAIR_INLINE unsigned cell_hash(Vec3<float> p, Vec3<float> corner, double cells_per_unit) {
  if (!(cells_per_unit > 0)) return position_hash(p, corner);
  const Vec3<double> d = exact_offset(p, corner);
  return scattered(__builtin_floor(d.x * cells_per_unit), __builtin_floor(d.y * cells_per_unit),
                   __builtin_floor(d.z * cells_per_unit));
}
// 2^16 of them fill the least power of two that the box's longest side does not exceed; 2^8 times as many with each
// refinement. 0 for a box without extent.
POINTFAIR_INLINE double cells_per_unit(Vec3<float> min, Vec3<float> max, int refinement) {
  const Vec3<double> sides = exact_offset(max, min);
  const double longest = larger(larger(sides.x, sides.y), sides.z);
  if (!(longest > 1e-30)) return 0;
  union {
    double f;
    unsigned long long u;
  } power = {longest};
  power.u = (power.u & 0x7ff0000000000000ull) + 0x0010000000000000ull;  // the power of two above it
  double cells = 65536.0 / power.f;
  for (int i = 0; i < refinement; ++i) cells *= 256.0;
  return cells;
}

}  // namespace pointfair::point
