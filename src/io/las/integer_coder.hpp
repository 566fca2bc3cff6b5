// SPDX-License-Identifier: Apache-2.0
// Integers in an arithmetic code, and their prediction: as the LASzip specification has them.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "io/las/arithmetic.hpp"

namespace pointfair::io::las {

/// Codes the difference of integers from their predictions: the number k of its bits, in one of several contexts, then
/// the bits, of which the upper eight have a probability. Integers of 16 bits are unsigned, their differences wrap.
class IntegerCoder {
 public:
  explicit IntegerCoder(std::size_t contexts, std::uint32_t bits = kMostBits)
      : sizes_(contexts, SizeModel(bits + 1)), unused_(kMostBits - bits) {
    for (std::uint32_t k = 1; k <= std::min(bits, kMostBits - 1); ++k)
      corrections_.emplace_back(1U << std::min(k, kUpperBits));
  }

  /// The k of the last difference.
  std::uint32_t last_size() const { return size_; }

  template <class Coder>
  std::int32_t code(Coder& coder, std::int32_t prediction, std::int32_t value, std::uint32_t context) {
    // c is from 2^(k-1) + 1 to 2^k, or from -(2^k - 1) to -2^(k-1); k = 0 stands for 0 and 1.
    const std::uint32_t difference = static_cast<std::uint32_t>(value) - static_cast<std::uint32_t>(prediction);
    const auto c = static_cast<std::uint32_t>(static_cast<std::int32_t>(difference << unused_) >> unused_);
    const bool negative = static_cast<std::int32_t>(c) <= 0;
    size_ = coder.code(sizes_[context], static_cast<std::uint32_t>(std::bit_width(negative ? -c : c - 1)));
    const std::uint32_t result = static_cast<std::uint32_t>(prediction) + code_correction(coder, c, negative);
    return static_cast<std::int32_t>(result << unused_ >> unused_);
  }

 private:
  static constexpr std::uint32_t kMostBits = 32, kUpperBits = 8;
  using SizeModel = BasicSymbolModel<kMostBits + 1>;

  template <class Coder>
  std::uint32_t code_correction(Coder& coder, std::uint32_t c, bool negative) {
    if (size_ == 0) return coder.code(bit_, c);
    if (size_ == kMostBits) return std::uint32_t{1} << 31;
    const std::uint32_t least = (std::uint32_t{1} << size_) - 1;
    std::uint32_t place = negative ? c + least : c - 1;
    if (size_ <= kUpperBits) {
      place = coder.code(corrections_[size_ - 1], place);
    } else {
      const std::uint32_t lower = size_ - kUpperBits;
      const std::uint32_t upper_bits = coder.code(corrections_[size_ - 1], place >> lower);
      place = upper_bits << lower | coder.code_bits(lower, place & ((std::uint32_t{1} << lower) - 1));
    }
    // without a branch on the sign, which none could predict
    const std::uint32_t is_positive = place >> (size_ - 1);
    return place - least + (is_positive << size_);
  }

  std::vector<SizeModel> sizes_;
  std::vector<SymbolModel> corrections_;
  std::uint32_t unused_;  // bits of 32
  BitModel bit_;
  std::uint32_t size_ = 0;
};

/// A running middle of the last values: five in order, of which a new one pushes out the largest or the smallest by
/// turns of what was above or below the middle.
class RunningMedian {
 public:
  std::int32_t value() const { return sorted_[2]; }

  void add(std::int32_t value) {
    const bool from_top = drop_largest_;
    // A value on the side that is not dropped from makes the other end the next to go.
    drop_largest_ ^= from_top ? value >= sorted_[2] : value <= sorted_[2];
    // without a branch, since none could be predicted
    const std::int32_t* const kept = sorted_.data() + !from_top;
    const std::int32_t a = kept[0], b = kept[1], c = kept[2], d = kept[3];
    sorted_ = {std::min(a, value), std::max(a, std::min(b, value)), std::max(b, std::min(c, value)),
               std::max(c, std::min(d, value)), std::max(d, value)};
  }

 private:
  std::array<std::int32_t, 5> sorted_{};
  bool drop_largest_ = true;
};

/// A coordinate as its step from the last point's, of which the middle of the last steps is the prediction.
template <class Coder, class Steps>
inline void code_along(Coder& coder, IntegerCoder& integers, Steps& steps, std::int32_t last, std::int32_t& now,
                       std::uint32_t context) {
  const auto wanted = static_cast<std::int32_t>(static_cast<std::uint32_t>(now) - static_cast<std::uint32_t>(last));
  const std::int32_t step = integers.code(coder, steps.value(), wanted, context);
  steps.add(step);
  now = static_cast<std::int32_t>(static_cast<std::uint32_t>(last) + static_cast<std::uint32_t>(step));
}

/// The context of an axis by the size of the step along the one before.
inline std::uint32_t even(std::uint32_t size, std::uint32_t most) { return size < most ? size & ~1U : most; }

}  // namespace pointfair::io::las
