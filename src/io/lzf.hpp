// SPDX-License-Identifier: Apache-2.0
// LZF, the compression of PCD files. The format (described with Marc Lehmann's liblzf): a control byte below 32 is
// followed by that many + 1 literal bytes; else its upper 3 bits are a length (7: the next byte is added) and its lower
// 5 bits with the byte that follows a distance - 1; length + 2 bytes are copied from that far back.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace pointfair::io {

/// No byte of compressed data stands for more than this many.
inline constexpr std::size_t kLzfLargestRatio = 88;

/// Fills `to` exactly. False: the data is damaged.
bool lzf_decompress(std::string_view from, char* to, std::size_t size);

/// Appends the compressed bytes to `to`. Results of consecutive pieces may be joined.
void lzf_compress(std::string_view from, std::string& to);

}  // namespace pointfair::io
