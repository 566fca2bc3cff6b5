// SPDX-License-Identifier: Apache-2.0
// The table of chunks, in an otherwise sound file. The first byte says the point format.
#include "laz_parts.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pointfair;
  if (size < 1) return 0;
  const fuzz::LazParts& parts = fuzz::parts_of(data[0] % 11);
  const std::string table(reinterpret_cast<const char*>(data) + 1, size - 1);
  return fuzz::run(fuzz::join(parts.front, parts.chunk, table), Format::las, false);
}
