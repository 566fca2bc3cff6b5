// SPDX-License-Identifier: Apache-2.0
// exp() for loops over many numbers: a body without branches that compilers turn into vectors.
#pragma once

#include <bit>
#include <cstdint>

namespace pointfair {

// Relative error below 3e-16 for -700 < x < 700 (tests/test_noise_levels.cpp); else any number. exp(x) = 2^n exp(r)
// with |r| <= log(2) / 2, by its Taylor series, whose first term left out is 2e-17 of the whole.
inline double exponential(double x) {
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
  const auto power = (std::bit_cast<std::uint64_t>(shifted) + 1023) << 52;  // the low bits of `shifted` are n
  return p * std::bit_cast<double>(power);
}

}  // namespace pointfair
