// SPDX-License-Identifier: Apache-2.0
// The items of LAZ in their first version, which LASzip wrote before 2.0. Their calls are those of the second version.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "io/las/byte_coding.hpp"
#include "io/las/integer_coder.hpp"
#include "io/las/point_item.hpp"

namespace pointfair::io::las {

/// The middle of the last three values.
class MiddleOfThree {
 public:
  std::int32_t value() const {
    const auto& [a, b, c] = values_;
    return std::max(std::min(a, b), std::min(std::max(a, b), c));
  }
  void add(std::int32_t value) {
    values_[turn_] = value;
    turn_ = (turn_ + 1) % values_.size();
  }

 private:
  std::array<std::int32_t, 3> values_{};
  std::size_t turn_ = 0;  // which of them is replaced next
};

/// Item POINT10: the coordinates first, then what else changed.
class FirstPointItem {
 public:
  explicit FirstPointItem(const char* first) : last_(PointFields::read(first)) {}

  static constexpr int kSteps = 1;

  template <int kStep, class Coder>
  void code_step(Coder& coder, char* record) {
    PointFields now = Coder::kWrites ? PointFields::read(record) : last_;
    code_grid(coder, now.grid);
    code_fields(coder, now);
    last_ = now;
    if constexpr (!Coder::kWrites) now.write(record);
  }

 private:
  static constexpr std::uint32_t kSource = 1, kUser = 2, kAngle = 4, kClass = 8, kReturns = 16, kIntensity = 32,
                                 kMostContext = 19;

  template <class Coder>
  void code_grid(Coder& coder, Grid& now) {
    code_along(coder, x_, x_steps_, last_.grid[0], now[0], 0);
    code_along(coder, y_, y_steps_, last_.grid[1], now[1], std::min(x_.last_size(), kMostContext));
    size_ = (x_.last_size() + y_.last_size()) / 2;
    now[2] = z_.code(coder, last_.grid[2], now[2], std::min(size_, kMostContext));
  }

  std::uint32_t changes_of(const PointFields& now) const {
    return (now.source != last_.source ? kSource : 0) | (now.user != last_.user ? kUser : 0) |
           (now.angle != last_.angle ? kAngle : 0) | (now.classification != last_.classification ? kClass : 0) |
           (now.returns != last_.returns ? kReturns : 0) | (now.intensity != last_.intensity ? kIntensity : 0);
  }

  template <class Coder>
  void code_fields(Coder& coder, PointFields& now) {
    const std::uint32_t changes = coder.code(changes_, Coder::kWrites ? changes_of(now) : 0);
    if ((changes & kIntensity) != 0)
      now.intensity = static_cast<std::uint16_t>(intensity_.code(coder, last_.intensity, now.intensity, 0));
    if ((changes & kReturns) != 0) now.returns = code_byte(coder, returns_.after(last_.returns), now.returns);
    if ((changes & kClass) != 0)
      now.classification = code_byte(coder, classes_.after(last_.classification), now.classification);
    if ((changes & kAngle) != 0)
      now.angle = static_cast<std::uint8_t>(angle_.code(coder, last_.angle, now.angle, size_ < 3 ? 1U : 0U));
    if ((changes & kUser) != 0) now.user = code_byte(coder, users_.after(last_.user), now.user);
    if ((changes & kSource) != 0)
      now.source = static_cast<std::uint16_t>(source_.code(coder, last_.source, now.source, 0));
  }

  PointFields last_;
  MiddleOfThree x_steps_, y_steps_;
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
