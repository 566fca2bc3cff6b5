// SPDX-License-Identifier: Apache-2.0
// The items of LAZ in their first version, which LASzip wrote before 2.0. Their calls are those of the second version.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "io/las/byte_coding.hpp"
#include "io/las/grid.hpp"
#include "io/las/integer_coder.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::las {

/// Item POINT10: the coordinates first, then what else changed.
class FirstPointItem {
 public:
  explicit FirstPointItem(const char* first) { std::copy_n(first, last_.size(), last_.data()); }

  static constexpr int kSteps = 1;

  template <int kStep, class Coder>
  void code_step(Coder& coder, char* record) {
    Bytes now = last_;
    if constexpr (Coder::kWrites) std::copy_n(record, now.size(), now.data());
    code_grid(coder, now);
    code_fields(coder, now);
    last_ = now;
    if constexpr (!Coder::kWrites) std::copy_n(now.data(), now.size(), record);
  }

 private:
  using Bytes = std::array<char, 20>;
  static constexpr std::size_t kIntensity = 12, kReturns = 14, kClass = 15, kAngle = 16, kUser = 17, kSource = 18;
  static constexpr std::uint32_t kSourceBit = 1, kUserBit = 2, kAngleBit = 4, kClassBit = 8, kReturnsBit = 16,
                                 kIntensityBit = 32, kMostContext = 19;

  static std::int32_t middle(const std::array<std::int32_t, 3>& values) {
    return std::max(std::min(values[0], values[1]), std::min(std::max(values[0], values[1]), values[2]));
  }

  template <class Coder>
  void code_grid(Coder& coder, Bytes& now) {
    code_along(coder, x_, x_steps_, 0, 0, now);
    code_along(coder, y_, y_steps_, std::min(x_.last_size(), kMostContext), 4, now);
    size_ = (x_.last_size() + y_.last_size()) / 2;
    const auto last = load_little<std::int32_t>(last_.data() + 8), wanted = load_little<std::int32_t>(now.data() + 8);
    store_little(now.data() + 8, z_.code(coder, last, wanted, std::min(size_, kMostContext)));
    turn_ = (turn_ + 1) % 3;
  }

  template <class Coder>
  void code_along(Coder& coder, IntegerCoder& integers, std::array<std::int32_t, 3>& steps, std::uint32_t context,
                  std::size_t at, Bytes& now) {
    const auto last = load_little<std::uint32_t>(&last_[at]);
    const auto wanted = static_cast<std::int32_t>(load_little<std::uint32_t>(&now[at]) - last);
    const std::int32_t step = integers.code(coder, middle(steps), wanted, context);
    steps[turn_] = step;
    store_little(&now[at], last + static_cast<std::uint32_t>(step));
  }

  std::uint32_t changes_of(const Bytes& now) const {
    const auto differs = [&](std::size_t at, std::size_t bytes) {
      return !std::equal(&now[at], &now[at] + bytes, &last_[at]);
    };
    return (differs(kSource, 2) ? kSourceBit : 0) | (differs(kUser, 1) ? kUserBit : 0) |
           (differs(kAngle, 1) ? kAngleBit : 0) | (differs(kClass, 1) ? kClassBit : 0) |
           (differs(kReturns, 1) ? kReturnsBit : 0) | (differs(kIntensity, 2) ? kIntensityBit : 0);
  }

  template <class Coder>
  void code_fields(Coder& coder, Bytes& now) {
    const std::uint32_t changes = coder.code(changes_, Coder::kWrites ? changes_of(now) : 0);
    if ((changes & kIntensityBit) != 0) code_wide(coder, intensity_, kIntensity, now);
    if ((changes & kReturnsBit) != 0) code_after_last(coder, returns_, kReturns, now);
    if ((changes & kClassBit) != 0) code_after_last(coder, classes_, kClass, now);
    if ((changes & kAngleBit) != 0)
      now[kAngle] = static_cast<char>(angle_.code(coder, byte(last_[kAngle]), byte(now[kAngle]), size_ < 3 ? 1U : 0U));
    if ((changes & kUserBit) != 0) code_after_last(coder, users_, kUser, now);
    if ((changes & kSourceBit) != 0) code_wide(coder, source_, kSource, now);
  }

  static std::uint8_t byte(char value) { return static_cast<std::uint8_t>(value); }

  template <class Coder>
  void code_after_last(Coder& coder, ByteModels& models, std::size_t at, Bytes& now) {
    now[at] = static_cast<char>(code_byte(coder, models.after(byte(last_[at])), byte(now[at])));
  }
  template <class Coder>
  void code_wide(Coder& coder, IntegerCoder& integers, std::size_t at, Bytes& now) {
    const auto value =
        integers.code(coder, load_little<std::uint16_t>(&last_[at]), load_little<std::uint16_t>(&now[at]), 0);
    store_little(&now[at], static_cast<std::uint16_t>(value));
  }

  Bytes last_;
  std::array<std::int32_t, 3> x_steps_{}, y_steps_{};  // the last three
  std::size_t turn_ = 0;                               // which of them is replaced next
  std::uint32_t size_ = 0;
  SymbolModel changes_{64};
  ByteModels returns_, classes_, users_;
  IntegerCoder x_{1}, y_{20}, z_{20}, intensity_{1, 16}, angle_{2, 8}, source_{1, 16};
};

/// Item GPSTIME11: the bits of a double, as multiples of the usual step.
class FirstTimeItem {
 public:
  explicit FirstTimeItem(const char* first) : time_(load_little<std::uint64_t>(first)) {}

  template <class Coder>
  void code(Coder& coder, char* record) {
    const std::uint64_t wanted = Coder::kWrites ? load_little<std::uint64_t>(record) : 0;
    const auto step = static_cast<std::int64_t>(wanted - time_);
    if (step_ == 0) {
      code_first(coder, step, wanted);
    } else {
      const std::uint32_t symbol = coder.code(multiples_, Coder::kWrites ? symbol_of(step) : 0);
      if (symbol < kAnywhere) code_multiple(coder, symbol, static_cast<std::int32_t>(step));
      if (symbol == kAnywhere) time_ = code_long(coder, wanted);
    }
    if constexpr (!Coder::kWrites) store_little(record, time_);
  }
  bool is_damaged() const { return false; }

 private:
  static constexpr std::uint32_t kMost = 509, kAnywhere = 510, kUnchanged = 511, kSymbols = 512;  // of multiples_
  static constexpr std::uint32_t kFirstSame = 0, kFirstStep = 1, kFirstAnywhere = 2;

  static bool is_short(std::int64_t step) { return step == static_cast<std::int32_t>(step); }

  std::uint32_t symbol_of(std::int64_t step) const {
    if (step == 0) return kUnchanged;
    if (!is_short(step)) return kAnywhere;
    const float ratio = static_cast<float>(step) / static_cast<float>(step_);
    return static_cast<std::uint32_t>(std::clamp(ratio + 0.5F, 0.0F, static_cast<float>(kMost)));
  }

  template <class Coder>
  void code_first(Coder& coder, std::int64_t step, std::uint64_t wanted) {
    const std::uint32_t symbol = step == 0 ? kFirstSame : is_short(step) ? kFirstStep : kFirstAnywhere;
    switch (coder.code(first_, symbol)) {
      case kFirstSame:
        break;
      case kFirstStep:
        step_ = code_step(coder, 0, static_cast<std::int32_t>(step), 0);
        break;
      default:
        time_ = code_long(coder, wanted);
    }
  }

  template <class Coder>
  std::int32_t code_step(Coder& coder, std::int32_t prediction, std::int32_t wanted, std::uint32_t context) {
    const std::int32_t step = integers_.code(coder, prediction, wanted, context);
    time_ += static_cast<std::uint64_t>(std::int64_t{step});
    return step;
  }

  template <class Coder>
  void code_multiple(Coder& coder, std::uint32_t multiple, std::int32_t wanted) {
    const std::uint32_t context = multiple == 1 ? 1 : multiple == 0 ? 2 : multiple < 10 ? 3 : multiple < 50 ? 4 : 5;
    const std::int32_t prediction =
        multiple == 0 ? step_ / 4 : static_cast<std::int32_t>(multiple * static_cast<std::uint32_t>(step_));
    const std::int32_t step = code_step(coder, prediction, wanted, context);
    const bool is_extreme = multiple == 0 || multiple == kMost;
    if (multiple == 1 || (is_extreme && ++extremes_ > 3)) {  // the usual step is another one now
      step_ = step;
      extremes_ = 0;
    }
  }

  std::uint64_t time_;
  std::int32_t step_ = 0, extremes_ = 0;
  BasicSymbolModel<kSymbols> multiples_{kSymbols};
  SymbolModel first_{3};
  IntegerCoder integers_{6};
};

class FirstDifferences : public IntegerCoder {
 public:
  explicit FirstDifferences(std::size_t bytes) : IntegerCoder(bytes, 8) {}
};

/// Item RGB12.
using FirstColorCoder = ChangedBytes<6, FirstDifferences>;
using FirstBytesItem = BasicBytesItem<FirstDifferences>;

}  // namespace pointfair::io::las
