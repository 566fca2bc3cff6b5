// SPDX-License-Identifier: Apache-2.0
// Whole points of LAZ chunks, in and out, by LASzip. Chunks are independent of each other: any number of threads may
// decode or encode at once.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "io/las/laz.hpp"

namespace pointfair::io::las {

/// Whether this build has LASzip. Without it, the calls below throw Error(file).
bool has_laszip();

/// Decodes the records of a chunk of `points` points. Of layered chunks only `layers` (see Layer) need be right.
/// False: the bytes are damaged.
bool decode_chunk(const Compression& compression, std::string_view chunk, std::uint32_t points, std::uint32_t layers,
                  std::span<char> records);

/// Appends the records, as many as fit in `records`, as a chunk.
void encode_chunk(const Compression& compression, std::span<const char> records, std::string& to);

}  // namespace pointfair::io::las
