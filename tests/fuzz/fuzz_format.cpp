// SPDX-License-Identifier: Apache-2.0
// Files as they are, of the format that the target is built for.
#include "fuzz_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr auto kFormat = pointfair::Format::FUZZED_FORMAT;
  return kFormat == pointfair::Format::glb ? pointfair::fuzz::run_read_only(data, size, kFormat)
                                           : pointfair::fuzz::run(data, size, kFormat);
}
