// SPDX-License-Identifier: Apache-2.0
// Whole points of LAZ chunks, in and out: by code of our own where there is some, else by LASzip. Chunks are
// independent of each other: any number of threads may decode or encode at once.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "io/las/interleaved.hpp"
#include "io/las/laz.hpp"

namespace pointfair::io::las {

/// Whether this build codes such points: without LASzip, those of formats 0 to 3 alone.
bool can_code(const Compression& compression);

/// Throws Error(file) where can_code is false, and says what to do; `what` begins the line.
void require_codec(const Compression& compression, const std::string& what);

/// Decodes the records of a chunk of `points` points. Of layered chunks only `layers` (see Layer) need be right.
/// False: the bytes are damaged. can_code must be true.
bool decode_chunk(const Compression& compression, const CodedChunk& chunk, std::uint32_t points, std::uint32_t layers);

/// Decodes the records of two chunks at once, which takes less time. False: one is damaged, or such points are decoded
/// a chunk at a time: decode_chunk tells.
bool decode_two_chunks(const Compression& compression, const CodedChunk& one, const CodedChunk& other);

/// Appends the records, as many as fit in `records`, as a chunk. can_code must be true.
void encode_chunk(const Compression& compression, std::span<const char> records, std::string& to);

}  // namespace pointfair::io::las
