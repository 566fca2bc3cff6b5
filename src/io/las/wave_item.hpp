// SPDX-License-Identifier: Apache-2.0
// Items WAVEPACKET13 and WAVEPACKET14 of LAZ: where the waveform of a point is, in 29 bytes. `code` predicts from the
// bytes of the point before, `last`; it reads a record with an Encoder and fills it with a Decoder.
#pragma once

#include <cstdint>
#include <vector>

#include "io/las/byte_coding.hpp"
#include "io/las/integer_coder.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::las {

class WaveCoder {
 public:
  template <class Coder>
  void code(Coder& coder, const char* last, char* record) {
    const auto index = code_byte(coder, index_, Coder::kWrites ? static_cast<std::uint8_t>(record[0]) : 0U);
    const auto size = load_little<std::uint32_t>(last + kSize);
    const std::uint64_t offset = code_offset(coder, load_little<std::uint64_t>(last + kOffset), size,
                                             Coder::kWrites ? load_little<std::uint64_t>(record + kOffset) : 0);
    if constexpr (!Coder::kWrites) {
      record[0] = static_cast<char>(index);
      store_little(record + kOffset, offset);
    }
    code_number(coder, size_, 0, last + kSize, record + kSize);
    code_number(coder, place_, 0, last + kPlace, record + kPlace);
    for (std::uint32_t axis = 0; axis < 3; ++axis)
      code_number(coder, direction_, axis, last + kDirection + 4 * axis, record + kDirection + 4 * axis);
  }

 private:
  static constexpr std::size_t kOffset = 1, kSize = 9, kPlace = 13, kDirection = 17;  // bytes of the item
  enum Step : std::uint32_t { kSame = 0, kNext = 1, kNear = 2, kAnywhere = 3 };       // of the offset

  Step step_of(std::uint64_t difference, std::uint32_t size) const {
    if (difference == 0) return kSame;
    const auto small = static_cast<std::int32_t>(difference);
    if (static_cast<std::uint64_t>(std::int64_t{small}) != difference) return kAnywhere;
    return difference == size ? kNext : kNear;
  }

  // `size`: of the packet before.
  template <class Coder>
  std::uint64_t code_offset(Coder& coder, std::uint64_t last, std::uint32_t size, std::uint64_t wanted) {
    step_ = coder.code(steps_[step_], Coder::kWrites ? step_of(wanted - last, size) : kSame);
    switch (step_) {
      case kSame:
        return last;
      case kNext:
        return last + size;
      case kNear:
        difference_ = differences_.code(coder, difference_, static_cast<std::int32_t>(wanted - last), 0);
        return last + static_cast<std::uint64_t>(std::int64_t{difference_});
      default:
        return code_long(coder, wanted);
    }
  }

  template <class Coder>
  static void code_number(Coder& coder, IntegerCoder& integers, std::uint32_t context, const char* last, char* record) {
    const auto wanted = Coder::kWrites ? load_little<std::int32_t>(record) : 0;
    const std::int32_t now = integers.code(coder, load_little<std::int32_t>(last), wanted, context);
    if constexpr (!Coder::kWrites) store_little(record, now);
  }

  SymbolModel index_{256};
  std::vector<SymbolModel> steps_ = std::vector(4, SymbolModel(4));
  IntegerCoder differences_{1}, size_{1}, place_{1}, direction_{3};
  std::uint32_t step_ = kSame;
  std::int32_t difference_ = 0;
};

}  // namespace pointfair::io::las
