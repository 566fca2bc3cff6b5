// SPDX-License-Identifier: Apache-2.0
// Whole points into LAZ chunks. Chunks are independent of each other: any number of threads may encode at once.
#pragma once

#include <span>
#include <string>

#include "io/las/interleaved.hpp"
#include "io/las/layered.hpp"

namespace pointfair::io::las {

/// Appends the records, as many as fit in `records`, as a chunk.
inline void encode_chunk(const Compression& compression, std::span<const char> records, std::string& to) {
  compression.layered() ? encode_layered(compression, records, to) : encode_interleaved(compression, records, to);
}

}  // namespace pointfair::io::las
