// SPDX-License-Identifier: Apache-2.0
// Chunks of points by LASzip.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "io/las/laz.hpp"

namespace pointfair::io::las {

/// Whether this build has LASzip. Without it, nobody calls the others.
bool has_laszip();

/// As decode_chunk and encode_chunk of src/io/las/codec.hpp, of any points.
bool laszip_decode(const Compression& compression, std::string_view chunk, std::uint32_t points, std::uint32_t layers,
                   std::span<char> records);
void laszip_encode(const Compression& compression, std::span<const char> records, std::string& to);

}  // namespace pointfair::io::las
