// SPDX-License-Identifier: Apache-2.0
// A chunk of compressed points in a sound file: the layers of point formats 6 to 10, the whole codec of 0 to 5. The
// first byte says the format, the second the number of points.
#include "io/las/interleaved.hpp"
#include "io/las/laz.hpp"
#include "laz_parts.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pointfair;
  if (size < 2) return 0;
  const unsigned format = data[0] % 11, points = data[1] + 1U;
  const fuzz::LazParts& parts = fuzz::parts_of(format);
  std::string front = parts.front;
  if (format < 6) test::las_put<std::uint32_t>(front, 107, points);
  test::las_put<std::uint64_t>(front, 247, points);
  const std::string chunk(reinterpret_cast<const char*>(data) + 2, size - 2);
  const std::size_t sizes[] = {chunk.size()};
  const std::uint32_t counts[] = {points};
  const std::size_t length = test::las_record_length(front);
  const io::las::Compression compression = io::las::usual_compression(format, length);
  std::string one(points * length, '\0'), other((points / 2 + 1) * length, '\0');
  if (format < 6) io::las::decode_two_interleaved(compression, {chunk, one}, {chunk, other});
  return fuzz::run(fuzz::join(front, chunk, io::las::chunk_table(compression, sizes, counts)), Format::las, false);
}
