// SPDX-License-Identifier: Apache-2.0
// E57 files without the checksums of their pages, which are put in: header, sections of points, packets, XML.
#include "e57_files.h"
#include "fuzz_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pointfair;
  if (size < 48) return 0;
  std::string logical(reinterpret_cast<const char*>(data), size);
  const std::uint64_t pages = (size + 1019) / 1020, length = pages * 1024;
  std::memcpy(logical.data() + 16, &length, 8);
  return fuzz::run(fuzz::as_bytes(test::e57_pages(std::move(logical))), Format::e57);
}
