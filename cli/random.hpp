// SPDX-License-Identifier: Apache-2.0
// Random numbers that are the same on every machine: integers, IEEE + - * / and square roots, nothing of the standard
// library's distributions or logarithms, whose last digits differ between machines.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

namespace pointfair::cli {

/// Natural logarithm of a positive normal number, to about 2e-16 of max(1, |result|).
/// ln(2^n m) = n ln 2 + 2 artanh((m - 1) / (m + 1)), 1/sqrt(2) <= m < sqrt(2), by the series of artanh.
inline double portable_log(double value) {
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(value);
  double exponent = static_cast<double>(static_cast<int>(bits >> 52) - 1023);
  double mantissa = std::bit_cast<double>((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
  if (mantissa > 1.4142135623730951) {
    mantissa *= 0.5;
    exponent += 1;
  }
  const double z = (mantissa - 1) / (mantissa + 1);
  const double z2 = z * z;  // at most 0.0295, so 11 terms reach 1e-17
  double series = 0;
  for (int n = 21; n >= 1; n -= 2) series = series * z2 + 1.0 / n;
  return exponent * 0.6931471805599453 + 2 * z * series;
}

/// e^value for value in [-700, 700], to about 4e-16 of the result: 2^n e^r with |r| <= ln(2) / 2, by Taylor's series.
inline double portable_exp(double value) {
  const double n = std::floor(value * 1.4426950408889634 + 0.5);
  const double r = (value - n * 0.693147180369123816490) - n * 1.90821492927058770002e-10;  // ln 2 in two parts
  double series = 1;
  for (int i = 14; i >= 1; --i) series = 1 + series * r / i;
  return series * std::bit_cast<double>(static_cast<std::uint64_t>(static_cast<int>(n) + 1023) << 52);
}

/// A counter-based generator: every (seed, purpose, index) names a stream of its own, so that points can be drawn in
/// any order by any number of threads. The mixing function is that of SplitMix64 (Steele, Lea, Flood 2014).
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t purpose, std::uint64_t index)
      : state_(mix(mix(mix(seed + kStep) + purpose * kStep) + index * kStep)) {}

  std::uint64_t bits() { return mix(state_ += kStep); }

  /// Uniform in [0, 1), a multiple of 2^-53.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  /// Two independent numbers of a standard normal distribution, by Marsaglia's polar method (1964).
  struct Pair {
    double first, second;
  };
  Pair normal_pair() {
    for (;;) {
      const double u = 2 * uniform() - 1;
      const double v = 2 * uniform() - 1;
      const double s = u * u + v * v;
      if (s >= 1 || s == 0) continue;
      const double factor = std::sqrt(-2 * portable_log(s) / s);
      return {u * factor, v * factor};
    }
  }

 private:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15u;  // 2^64 / golden ratio

  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  std::uint64_t state_;
};

}  // namespace pointfair::cli
