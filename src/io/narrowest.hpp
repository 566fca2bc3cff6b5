// SPDX-License-Identifier: Apache-2.0
// The types of columns of text.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "io/scalar.hpp"
#include "io/text.hpp"
#include "portable.hpp"

namespace pointfair::io {

/// What the numbers of a column have in common, and so the narrowest type that holds them without losing a digit.
struct Narrowest {
  bool numbers = true, integers = true, fits_float = true;
  bool filled = false;  ///< some word is not empty
  bool fits_int64 = true, fits_uint64 = true;
  bool has_wide = false;  ///< some whole number has more digits than a double
  double low = 0, high = 0;

  /// `decimal`: what stands before the decimals.
  void see(std::string_view word, char decimal = '.') {
    if (word.empty()) {
      integers = false;
      return;
    }
    filled = true;
    if (see_short_number(word)) return;
    if (decimal != '.' && word.find(decimal) != std::string_view::npos) {
      std::string plain(word);
      std::replace(plain.begin(), plain.end(), decimal, '.');
      return see(plain);
    }
    const std::optional<double> value = to_number(word);
    if (!value) {
      numbers = integers = false;
      return;
    }
    const int decimals = decimals_of(word);
    integers = integers && decimals == 0 && !(*value == 0 && std::signbit(*value));  // no integer is -0
    low = std::min(low, *value);
    high = std::max(high, *value);
    if (!std::isfinite(*value)) return;
    if (decimals == 0 && std::abs(*value) > kExactIntegers) {
      has_wide = true;
      see_digits(word);
    }
    // A float suffices if, printed with as many decimals, it gives the same word.
    const double error = std::abs(static_cast<double>(static_cast<float>(*value)) - *value);
    fits_float = fits_float && (error == 0 || (decimals >= 0 && error < 0.5 * portable::power_of_ten(-decimals)) ||
                                (decimals < 0 && error <= 5e-8 * std::abs(*value)));
  }
  void merge(const Narrowest& other) {
    numbers = numbers && other.numbers;
    integers = integers && other.integers;
    fits_float = fits_float && other.fits_float;
    filled = filled || other.filled;
    fits_int64 = fits_int64 && other.fits_int64;
    fits_uint64 = fits_uint64 && other.fits_uint64;
    has_wide = has_wide || other.has_wide;
    low = std::min(low, other.low);
    high = std::max(high, other.high);
  }
  NativeType type() const {
    if (integers && low >= 0 && high <= 255) return NativeType::uint8;
    if (integers && low >= std::numeric_limits<std::int32_t>::min() && high <= std::numeric_limits<std::int32_t>::max())
      return NativeType::int32;
    if (integers && std::max(-low, high) > kExactIntegers && fits_int64) return NativeType::int64;
    if (integers && high > kExactIntegers && low >= 0 && fits_uint64) return NativeType::uint64;
    return fits_float ? NativeType::float32 : NativeType::float64;
  }

 private:
  static constexpr double kExactIntegers = 9007199254740992.0;  // 2^53, beyond which doubles leave some out

  // The usual words of colours, classes and intensities. False: look closer. With fewer than 2^23 units of its last
  // decimal, a number is less than half a unit from a float; then nothing but that it is no integer is at stake.
  bool see_short_number(std::string_view word) {
    constexpr std::size_t kMostDigits = 7;
    constexpr int kUnits = 1 << 23;
    int value = 0;
    std::size_t digits = 0, point = word.size();
    for (std::size_t i = word.starts_with('-'); i < word.size(); ++i) {
      if (word[i] == '.' && point == word.size()) {
        point = i;
        continue;
      }
      if (word[i] < '0' || word[i] > '9' || ++digits > kMostDigits) return false;
      value = 10 * value + (word[i] - '0');
    }
    if (point == word.size()) {
      if (word[0] == '-' || digits == 0) return false;
      high = std::max<double>(high, value);
      return true;
    }
    if (value >= kUnits || point + 1 == word.size() || digits == 0) return false;
    integers = false;
    return true;
  }

  void see_digits(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    std::int64_t with_sign = 0;
    std::uint64_t without = 0;
    fits_int64 = fits_int64 && std::from_chars(word.data(), word.data() + word.size(), with_sign).ec == std::errc();
    fits_uint64 = fits_uint64 && std::from_chars(word.data(), word.data() + word.size(), without).ec == std::errc();
  }
};

}  // namespace pointfair::io
