// SPDX-License-Identifier: Apache-2.0
// Item GPSTIME11 of LAZ, version 2, and the GPS time of POINT14: the bits of a double, as differences within up to four
// sequences of times. `code` reads a record with an Encoder and fills it with a Decoder.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "io/las/integer_coder.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::las {

/// `kMayStay`: there are symbols for a time that is the last point's. Where there are layers, the first of them says
/// so.
template <bool kMayStay>
class BasicTimeItem {
 public:
  explicit BasicTimeItem(const char* first) { times_[0] = load_little<std::uint64_t>(first); }

  template <class Coder>
  void code(Coder& coder, char* record) {
    const std::uint64_t time = Coder::kWrites ? load_little<std::uint64_t>(record) : 0;
    // a time goes over to another sequence at most once; damaged bytes may say otherwise
    int switches = 0;
    while (code_in_sequence(coder, time)) {
      if (++switches > 1) {
        damaged_ = true;
        break;
      }
    }
    if constexpr (!Coder::kWrites) store_little(record, times_[at_]);
  }

  bool is_damaged() const { return damaged_; }

 private:
  static constexpr std::int32_t kMost = 500, kLeast = -10;  // multiples of the last difference
  static constexpr std::uint32_t kUnchanged = 511, kNew = kMayStay ? 512 : 511,
                                 kSymbols = kNew + 4;  // above kNew: other sequences
  static constexpr std::uint32_t kFirstSame = 0, kFirstStep = kMayStay ? 1 : 0, kFirstNew = kFirstStep + 1,
                                 kFirstSymbols = kFirstNew + 4;  // above kFirstNew: other sequences

  std::int64_t step_from(std::uint32_t sequence, std::uint64_t time) const {
    return static_cast<std::int64_t>(time - times_[sequence]);
  }
  static bool is_short(std::int64_t step) { return step == static_cast<std::int32_t>(step); }

  // How many sequences farther one is that the time continues; 0: there is none.
  std::uint32_t other_sequence(std::uint64_t time) const {
    for (std::uint32_t i = 1; i < 4; ++i)
      if (is_short(step_from((at_ + i) & 3, time))) return i;
    return 0;
  }

  std::uint32_t first_symbol(std::uint64_t time) const {
    const std::int64_t step = step_from(at_, time);
    if (is_short(step)) return kMayStay && step == 0 ? kFirstSame : kFirstStep;
    return kFirstNew + other_sequence(time);
  }

  std::uint32_t multiple_symbol(std::uint64_t time) const {
    const std::int64_t step = step_from(at_, time);
    if (!is_short(step)) return kNew + other_sequence(time);
    if (kMayStay && step == 0) return kUnchanged;
    const double ratio = static_cast<float>(step) / static_cast<float>(steps_[at_]);
    const double bounded = std::clamp(ratio, 2.0 * kLeast, 2.0 * kMost);
    const auto multiple = static_cast<std::int32_t>(bounded + (ratio >= 0 ? 0.5 : -0.5));
    if (multiple >= 0) return static_cast<std::uint32_t>(std::min(multiple, kMost));
    return static_cast<std::uint32_t>(kMost - std::max(multiple, kLeast));
  }

  // True: the time is in another sequence, from which to go on.
  template <class Coder>
  bool code_in_sequence(Coder& coder, std::uint64_t time) {
    const bool first = steps_[at_] == 0;
    const std::uint32_t fresh = first ? kFirstNew : kNew;
    const std::uint32_t symbol = first ? coder.code(first_, Coder::kWrites ? first_symbol(time) : 0)
                                       : coder.code(multiples_, Coder::kWrites ? multiple_symbol(time) : 0);
    if (symbol > fresh) {
      at_ = (at_ + symbol - fresh) & 3;
      return true;
    }
    if (symbol == fresh) {
      begin_sequence(coder, time);
    } else if (first && symbol == kFirstStep) {
      steps_[at_] = code_step(coder, time, 0, 0);
      extremes_[at_] = 0;
    } else if (!first && !(kMayStay && symbol == kUnchanged)) {
      code_multiple(coder, time, static_cast<std::int32_t>(symbol));
    }
    return false;
  }

  template <class Coder>
  std::int32_t code_step(Coder& coder, std::uint64_t time, std::int32_t multiple, std::uint32_t context) {
    const auto prediction = static_cast<std::uint32_t>(multiple) * static_cast<std::uint32_t>(steps_[at_]);
    const auto wanted = static_cast<std::int32_t>(step_from(at_, time));
    const std::int32_t step = integers_.code(coder, static_cast<std::int32_t>(prediction), wanted, context);
    times_[at_] += static_cast<std::uint64_t>(std::int64_t{step});
    return step;
  }

  template <class Coder>
  void code_multiple(Coder& coder, std::uint64_t time, std::int32_t symbol) {
    const std::int32_t multiple = symbol <= kMost ? symbol : kMost - symbol;
    const std::uint32_t context = multiple == 1       ? 1
                                  : multiple == 0     ? 7
                                  : multiple == kMost ? 4
                                  : multiple >= 10    ? 3
                                  : multiple > 0      ? 2
                                  : multiple > kLeast ? 5
                                                      : 6;
    const std::int32_t step = code_step(coder, time, multiple, context);
    if (multiple == 1) extremes_[at_] = 0;
    const bool extreme = multiple == 0 || multiple == kMost || multiple == kLeast;
    if (extreme && ++extremes_[at_] > 3) {  // the usual step is another one now
      steps_[at_] = step;
      extremes_[at_] = 0;
    }
  }

  template <class Coder>
  void begin_sequence(Coder& coder, std::uint64_t time) {
    const auto upper_half = [](std::uint64_t value) { return static_cast<std::int32_t>(value >> 32); };
    const std::int32_t upper = integers_.code(coder, upper_half(times_[at_]), upper_half(time), 8);
    const std::uint32_t lower = coder.code_bits(32, static_cast<std::uint32_t>(time));
    newest_ = (newest_ + 1) & 3;
    at_ = newest_;
    times_[at_] = std::uint64_t{static_cast<std::uint32_t>(upper)} << 32 | lower;
    steps_[at_] = 0;
    extremes_[at_] = 0;
  }

  std::uint32_t at_ = 0, newest_ = 0;  // sequences
  std::array<std::uint64_t, 4> times_{};
  std::array<std::int32_t, 4> steps_{}, extremes_{};
  BasicSymbolModel<kSymbols> multiples_{kSymbols};
  SymbolModel first_{kFirstSymbols};
  IntegerCoder integers_{9};
  bool damaged_ = false;
};

using TimeItem = BasicTimeItem<true>;
using LayeredTimeItem = BasicTimeItem<false>;

}  // namespace pointfair::io::las
