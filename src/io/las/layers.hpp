// SPDX-License-Identifier: Apache-2.0
// The coordinates of a LAZ chunk of point format 6 to 10. Such a chunk is its first point as it is, the number of its
// points, and then separately compressed layers, of which the first two hold returns with X and Y, and Z. The others
// depend on the first two only through the scanner channel, the numbers of returns and whether the GPS time changed:
// so coordinates can be decoded, changed and encoded while all other layers are copied as they are.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "io/las/grid.hpp"

namespace pointfair::io::las {

/// What the first layer tells of a point beside X and Y, which coding it again needs.
struct Returns {
  std::uint16_t number : 4, count : 4, channel : 2;
  std::uint16_t time_changed : 1, angle_changed : 1, source_changed : 1;  ///< against the channel's last point
};
static_assert(sizeof(Returns) == 2);

/// Where the parts of a chunk lie in it.
struct LayeredChunk {
  std::string_view first_point, sizes, returns_xy, z, others;
};

/// Takes a chunk of `points` points apart, whose records have `record_length` bytes and whose items have `layers`
/// layers in all. Returns nothing if the bytes do not fit.
std::optional<LayeredChunk> split_layers(std::string_view chunk, std::size_t record_length, std::size_t layers,
                                         std::uint32_t points);

/// Decodes the coordinates of all points of the chunk. False: the bytes are damaged.
bool decode_layers(const LayeredChunk& chunk, std::span<Grid> points, std::span<Returns> returns);

/// The codes of the two first layers, of the points and returns of a chunk.
struct CoordinateCodes {
  std::string returns_xy, z;
};
CoordinateCodes encode_coordinates(std::span<const Grid> points, std::span<const Returns> returns);

/// Appends the chunk with these coordinates instead of its own.
void encode_layers(const LayeredChunk& chunk, std::span<const Grid> points, std::span<const Returns> returns,
                   std::string& to);

}  // namespace pointfair::io::las
