// SPDX-License-Identifier: Apache-2.0
#include "io/colors.hpp"

#include <algorithm>
#include <cmath>

namespace pointfair::io {
namespace {

constexpr double kRounded = 1.001;  // of text, for 1

bool are_bytes(std::span<const TableColumn* const> channels) {
  return std::ranges::all_of(channels, [](const TableColumn* channel) { return channel->type == NativeType::uint8; });
}

// Calls visit(point, value) for all values of a channel.
template <class Visit>
void for_each_value(const TableColumn& channel, const Visit& visit) {
  const std::size_t size = size_of(channel.type), points = channel.value_count();
  with_type(channel.type, [&](auto tag) {
    for (std::size_t i = 0; i < points; ++i)
      visit(i, static_cast<double>(load<decltype(tag)>(channel.data.data() + i * size, false)));
  });
}

// Opacity from 0 to 1 goes with such colours where no digit of it is lost.
void use_byte_opacity(Table& table) {
  const auto alpha = std::ranges::find(table.columns, "alpha", &TableColumn::name);
  if (alpha == table.columns.end() || is_integer(alpha->type)) return;
  const TableColumn* const opacity = &*alpha;
  const ColorRange range = color_range({&opacity, 1});
  if (range.factor != 255 || range.fine || range.missing > 0) return;
  change_values(*alpha, NativeType::uint8, [](std::size_t, double value) { return 255 * value; });
}

}  // namespace

ColorRange color_range(std::span<const TableColumn* const> channels) {
  ColorRange range;
  if (are_bytes(channels)) return range;
  double most = 0;
  bool integers = true;
  for (const TableColumn* channel : channels) {
    integers = integers && is_integer(channel->type);
    for_each_value(*channel, [&](std::size_t, double value) { most = value > most ? value : most; });  // NaN is not
  }
  const bool bytes = most <= 255.5;
  range.factor = !integers && most <= kRounded && most > 0 ? 255 : bytes ? 1 : 255.0 / 65535;
  range.fine = !bytes;
  std::vector<bool> missing;
  for (const TableColumn* channel : channels) {
    if (is_integer(channel->type)) continue;
    missing.resize(channel->value_count());
    for_each_value(*channel, [&](std::size_t point, double value) {
      constexpr double kDigits = 0.03;  // of four decimals, and of floats
      if (std::isnan(value)) missing[point] = true;
      range.fine = range.fine || std::abs(range.factor * value - std::nearbyint(range.factor * value)) > kDigits;
    });
  }
  range.missing = static_cast<std::uint64_t>(std::ranges::count(missing, true));
  return range;
}

ByteColors colors_as_bytes(const Table& table) {
  ByteColors colors;
  const auto channels = table.find_all(kChannels);
  if (channels.empty()) return colors;
  const ColorRange range = color_range(channels);
  colors.values.resize(table.size());
  if (range.missing > 0) colors.missing.resize(table.size());
  for (std::size_t c = 0; c < 3; ++c)
    for_each_value(*channels[c], [&](std::size_t point, double value) {
      if (std::isnan(value) && range.missing > 0) colors.missing[point] = true;
      colors.values[point][c] = narrow<std::uint8_t>(range.factor * value);
    });
  for (std::size_t point = 0; point < colors.missing.size(); ++point)
    if (colors.missing[point]) colors.values[point] = {255, 255, 255};
  return colors;
}

void use_color_depth(Table& table, ColorDepth depth) {
  const auto channels = table.find_all(kChannels);
  if (channels.empty() || are_bytes(channels)) return;
  const ColorRange range = color_range(channels);
  if (depth == ColorDepth::any && (range.fine || range.missing > 0)) return;
  const bool wide = depth == ColorDepth::sixteen_bits && range.fine;
  const ByteColors colors = colors_as_bytes(table);
  for (std::size_t c = 0; c < 3; ++c) {
    TableColumn& column = *std::ranges::find(table.columns, kChannels[c], &TableColumn::name);
    change_values(column, wide ? NativeType::uint16 : NativeType::uint8, [&](std::size_t i, double value) {
      if (!wide) return static_cast<double>(colors.values[i][c]);
      return colors.has(i) ? 257 * range.factor * value : 65535.0;
    });
  }
  if (range.factor == 255 && depth != ColorDepth::sixteen_bits) use_byte_opacity(table);
}

}  // namespace pointfair::io
