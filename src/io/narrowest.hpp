// SPDX-License-Identifier: Apache-2.0
// The types of columns of text.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

#include "io/scalar.hpp"
#include "io/text.hpp"

namespace pointfair::io {

/// What the numbers of a column have in common, and so the narrowest type that holds them without losing a digit.
struct Narrowest {
  bool numbers = true, integers = true, fits_float = true;
  double low = 0, high = 0;

  void see(std::string_view word) {
    const std::optional<double> value = to_number(word);
    if (!value) {
      numbers = numbers && word.empty();
      integers = false;
      return;
    }
    const int decimals = decimals_of(word);
    integers = integers && decimals == 0;
    low = std::min(low, *value);
    high = std::max(high, *value);
    if (!std::isfinite(*value)) return;
    // A float suffices if, printed with as many decimals, it gives the same word.
    const double error = std::abs(static_cast<double>(static_cast<float>(*value)) - *value);
    fits_float = fits_float && (error == 0 || (decimals >= 0 && error < 0.5 * std::pow(10.0, -decimals)) ||
                                (decimals < 0 && error <= 5e-8 * std::abs(*value)));
  }
  void merge(const Narrowest& other) {
    numbers = numbers && other.numbers;
    integers = integers && other.integers;
    fits_float = fits_float && other.fits_float;
    low = std::min(low, other.low);
    high = std::max(high, other.high);
  }
  NativeType type() const {
    if (integers && low >= 0 && high <= 255) return NativeType::uint8;
    if (integers && low >= std::numeric_limits<std::int32_t>::min() && high <= std::numeric_limits<std::int32_t>::max())
      return NativeType::int32;
    return fits_float ? NativeType::float32 : NativeType::float64;
  }
};

}  // namespace pointfair::io
