// SPDX-License-Identifier: Apache-2.0
// LAS and LAZ files as they are: header, records, descriptions of extra bytes, tables of chunks, chunks.
#include "fuzz_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto* const begin = reinterpret_cast<const std::byte*>(data);
  const bool compressed = size > 104 && (data[104] & 0xC0) != 0;
  return pointfair::fuzz::run({begin, begin + size}, pointfair::Format::las, !compressed);
}
