// SPDX-License-Identifier: Apache-2.0
// Items RGB12, version 2, and RGB14 of LAZ, three channels of 16 bits, and the near infrared that may follow them.
// `code` predicts from the bytes of the point before, `last`; it reads a record with an Encoder and fills it with a
// Decoder.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "io/las/byte_coding.hpp"

namespace pointfair::io::las {

// The lower bytes of three channels, and the upper ones, each predicted from the channel before.
class ColorCoder {
 public:
  template <class Coder>
  void code(Coder& coder, const char* last_bytes, char* record) {
    const Color last = read(last_bytes);
    Color now = Coder::kWrites ? read(record) : last;
    const std::uint32_t changes = coder.code(changes_, Coder::kWrites ? changes_of(last, now) : 0);
    for (std::uint32_t half = 0; half < 2; ++half)
      if ((changes >> half & 1) != 0) now[0][half] = code_difference(coder, bytes_[half], last[0][half], now[0][half]);
    for (std::uint32_t half = 0; half < 2; ++half) {
      if ((changes & kColored) != 0) {
        code_others(coder, changes >> half, half, last, now);
      } else {
        now[1][half] = now[2][half] = now[0][half];
      }
    }
    if constexpr (!Coder::kWrites) {
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t half = 0; half < 2; ++half) record[2 * c + half] = static_cast<char>(now[c][half]);
    }
  }

 private:
  using Color = std::array<std::array<std::uint8_t, 2>, 3>;  // of a channel the lower byte, then the upper
  static constexpr std::uint32_t kColored = 64;              // the channels are not all alike

  static Color read(const char* record) {
    Color color;
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t half = 0; half < 2; ++half) color[c][half] = static_cast<std::uint8_t>(record[2 * c + half]);
    return color;
  }

  static std::uint32_t changes_of(const Color& last, const Color& now) {
    std::uint32_t changes = now[0] != now[1] || now[0] != now[2] ? kColored : 0;
    for (std::uint32_t c = 0; c < 3; ++c)
      for (std::uint32_t half = 0; half < 2; ++half)
        changes |= static_cast<std::uint32_t>(now[c][half] != last[c][half]) << (2 * c + half);
    return changes;
  }

  // Bits 2 and 4 of `changes` say whether the second and the third channel changed.
  template <class Coder>
  void code_others(Coder& coder, std::uint32_t changes, std::uint32_t half, const Color& last, Color& now) {
    const auto near = [](int value) { return static_cast<std::uint32_t>(std::clamp(value, 0, 255)); };
    int difference = now[0][half] - last[0][half];
    if ((changes & 4) != 0)
      now[1][half] = code_difference(coder, bytes_[2 + half], near(difference + last[1][half]), now[1][half]);
    difference = (difference + now[1][half] - last[1][half]) / 2;
    if ((changes & 16) != 0)
      now[2][half] = code_difference(coder, bytes_[4 + half], near(difference + last[2][half]), now[2][half]);
  }

  SymbolModel changes_{128};
  std::vector<SymbolModel> bytes_ = std::vector(6, SymbolModel(256));
};

using NearInfraredCoder = ChangedBytes<2, ByteDifferences>;

}  // namespace pointfair::io::las
