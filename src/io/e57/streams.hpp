// SPDX-License-Identifier: Apache-2.0
// The compressed points of a scan: packets, in each a piece of the stream of every field. A stream is the field's
// values, bits of one after bits of the other, the lowest first, through all packets.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/e57/document.hpp"

namespace pointfair::io::e57 {

/// A piece of a stream in a packet.
struct Piece {
  std::uint64_t begin = 0;  ///< in the stream, in bytes
  std::uint64_t place = 0;  ///< logical, in the file
  std::uint32_t size = 0;
  std::uint64_t end() const { return begin + size; }
};

/// The pieces of each field's stream in their order. Throws Error(file) if they do not hold all records, or if the
/// scan's section is longer than `left`, from which it is taken: sections do not overlap.
std::vector<std::vector<Piece>> find_streams(std::string_view file, const Scan& scan, std::size_t index,
                                             std::uint64_t& left, const std::string& name);

/// Copies the bytes [begin, end) of a stream.
void read_stream(std::string_view file, const std::vector<Piece>& pieces, std::uint64_t begin, std::uint64_t end,
                 std::string& to);

/// The integer of `bits` bits that begins at bit `at`; reads up to 9 bytes.
inline std::uint64_t get_bits(const char* bytes, std::uint64_t at, unsigned bits) {
  std::uint64_t value = 0;
  for (unsigned done = 0; done < bits;) {
    const unsigned within = static_cast<unsigned>(at % 8);
    value |= std::uint64_t{static_cast<unsigned char>(bytes[at / 8])} >> within << done;
    done += 8 - within;
    at += 8 - within;
  }
  return bits == 64 ? value : value & ((std::uint64_t{1} << bits) - 1);
}

/// Puts the bits of an integer at bit `at` of `size` bytes; those that lie outside are left out.
inline void put_bits(char* bytes, std::size_t size, std::int64_t at, unsigned bits, std::uint64_t value) {
  for (unsigned done = 0; done < bits;) {
    const std::int64_t place = at + done;
    const std::int64_t byte = place >= 0 ? place / 8 : -((7 - place) / 8);
    const auto within = static_cast<unsigned>(place - byte * 8);
    const unsigned count = std::min(8 - within, bits - done);
    const auto mask = static_cast<unsigned>(((1U << count) - 1) << within);
    if (byte >= 0 && static_cast<std::uint64_t>(byte) < size) {
      const auto old = static_cast<unsigned char>(bytes[byte]);
      bytes[byte] = static_cast<char>((old & ~mask) | (static_cast<unsigned>(value >> done) << within & mask));
    }
    done += count;
  }
}

}  // namespace pointfair::io::e57
