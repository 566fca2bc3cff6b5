// SPDX-License-Identifier: Apache-2.0
// Colours in their many ranges: bytes, 16 bits, floats from 0 to 1, 255 or 65535.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "io/table.hpp"

namespace pointfair::io {

inline constexpr std::array<std::string_view, 3> kChannels = {"red", "green", "blue"};

/// Colours as bytes; none if the table has no red, green and blue.
struct ByteColors {
  std::vector<std::array<std::uint8_t, 3>> values;
  std::vector<bool> missing;  ///< points without a colour, which are white; empty if there are none

  bool has(std::size_t point) const { return !values.empty() && (missing.empty() || !missing[point]); }
};

/// What the values of three channels say about their range.
struct ColorRange {
  double factor = 1;          ///< to 0..255
  bool fine = false;          ///< more than 8 bits are used
  std::uint64_t missing = 0;  ///< points without a colour
};
ColorRange color_range(std::span<const TableColumn* const> channels);

ByteColors colors_as_bytes(const Table& table);

/// Makes the columns red, green and blue bytes; with more depth only those that need it.
void use_color_depth(Table& table, ColorDepth depth);

}  // namespace pointfair::io
