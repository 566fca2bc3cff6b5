// SPDX-License-Identifier: Apache-2.0
// Whole points of a LAZ chunk of point format 6 to 10: the layers besides returns and coordinates, each of which is
// coded by itself.
#pragma once

#include <span>
#include <string>

#include "io/las/layers.hpp"
#include "io/las/laz.hpp"

namespace pointfair::io::las {

/// Fills `records`, which are 0, with the chunk's first record, the returns of all, which are known, and every layer
/// that has some of the bytes `wanted`. Coordinates are put in by put_grid. False: the bytes are damaged.
bool decode_layered(const Compression& compression, const LayeredChunk& chunk, std::span<const Returns> returns,
                    ByteRange wanted, std::span<char> records);

/// Appends the records as a chunk: the bytes that LASzip writes, but for times of which only the sign of zero differs,
/// which it loses.
void encode_layered(const Compression& compression, std::span<const char> records, std::string& to);

}  // namespace pointfair::io::las
