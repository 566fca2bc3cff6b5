// SPDX-License-Identifier: Apache-2.0
// The XML section of an E57 file whose points are sound.
#include "e57_sample.h"
#include "fuzz_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pointfair;
  static const std::string before = [] {
    const std::string logical = fuzz::logical_bytes(fuzz::e57_sample());
    return logical.substr(0, logical.find("<?xml"));
  }();
  std::string logical = before + std::string(reinterpret_cast<const char*>(data), size);
  const std::uint64_t numbers[] = {(logical.size() + 1019) / 1020 * 1024, test::e57_physical(before.size()), size,
                                   1024};
  std::memcpy(logical.data() + 16, numbers, sizeof numbers);
  return fuzz::run(fuzz::as_bytes(test::e57_pages(std::move(logical))), Format::e57);
}
