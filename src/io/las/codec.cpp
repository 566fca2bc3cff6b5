// SPDX-License-Identifier: Apache-2.0
#include "io/las/codec.hpp"

#include "io/las/interleaved.hpp"
#include "io/las/laszip_codec.hpp"
#include "pointfair/cloud.hpp"

namespace pointfair::io::las {

bool can_code(const Compression& compression) { return has_laszip() || is_interleaved(compression); }

void require_codec(const Compression& compression, const std::string& what) {
  if (can_code(compression)) return;
  throw Error(ErrorKind::file, what +
                                   " LASzip, which this build lacks; install pip for Python 3 and build again with "
                                   "-DPOINTFAIR_LAS=ON, which fetches it, or use LAS");
}

bool decode_chunk(const Compression& compression, const CodedChunk& chunk, std::uint32_t points, std::uint32_t layers) {
  if (is_interleaved(compression)) return decode_interleaved(compression, chunk);
  return laszip_decode(compression, chunk.bytes, points, layers, chunk.records);
}

bool decode_two_chunks(const Compression& compression, const CodedChunk& one, const CodedChunk& other) {
  return is_interleaved(compression) && decode_two_interleaved(compression, one, other);
}

void encode_chunk(const Compression& compression, std::span<const char> records, std::string& to) {
  if (is_interleaved(compression)) return encode_interleaved(compression, records, to);
  laszip_encode(compression, records, to);
}

}  // namespace pointfair::io::las
