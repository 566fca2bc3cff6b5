// SPDX-License-Identifier: Apache-2.0
// exp() of doubles, made of + and * alone, so that every device rounds it alike (src/portable.hpp).
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// For loops over many numbers: a body without branches that compilers turn into vectors. Error below 3e-16 of the
// result for -700 < x < 700; else any number. exp(x) = 2^n exp(r) with |r| <= log(2) / 2, by its Taylor series, whose
// first term left out is 2e-17 of the whole.
POINTFAIR_INLINE double exp_within_700(double x) {
  constexpr double kShift = 0x1.8p52;  // a number added to it is rounded to an integer
  constexpr double kLog2High = 0x1.62e42fee00000p-1, kLog2Low = 0x1.a39ef35793c76p-33;  // n times the first is exact
  const double shifted = x * 1.4426950408889634 + kShift, n = shifted - kShift;
  const double r = (x - n * kLog2High) - n * kLog2Low;
  double p = 1.0 / 6227020800;
  p = p * r + 1.0 / 479001600;
  p = p * r + 1.0 / 39916800;
  p = p * r + 1.0 / 3628800;
  p = p * r + 1.0 / 362880;
  p = p * r + 1.0 / 40320;
  p = p * r + 1.0 / 5040;
  p = p * r + 1.0 / 720;
  p = p * r + 1.0 / 120;
  p = p * r + 1.0 / 24;
  p = p * r + 1.0 / 6;
  p = p * r + 0.5;
  p = p * r + 1;
  p = p * r + 1;
  // the low bits of `shifted` are n
  const auto power = (__builtin_bit_cast(unsigned long long, shifted) + 1023) << 52;
  return p * __builtin_bit_cast(double, power);
}

// Error below 3e-16 of the result. 0 below -700, infinite above 700.
POINTFAIR_INLINE double exponential(double x) {
  if (x < -700) return 0;
  if (x > 700) return __builtin_inf();
  return x == x ? exp_within_700(x) : x;
}

}  // namespace pointfair::point
