// SPDX-License-Identifier: Apache-2.0
// Text whose columns are named by the caller, and whose first lines are passed over: the first two bytes say how.
#include "fuzz_reader.h"

namespace {

using namespace pointfair;

// Names by the bits of a byte.
std::vector<std::string> columns_of(unsigned bits) {
  std::vector<std::string> columns = {"x", "y", "z"};
  if ((bits & 1) != 0) columns.insert(columns.begin(), "id");
  if ((bits & 2) != 0) columns.insert(columns.begin() + 1, "red");
  if ((bits & 4) != 0) std::swap(columns[0], columns.back());
  if ((bits & 8) != 0) columns.emplace_back("intensity");
  if ((bits & 16) != 0) columns.emplace_back("red");
  if ((bits & 32) != 0) columns.clear();  // as the file says
  return columns;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  constexpr Format kFormats[] = {Format::xyz, Format::txt, Format::csv, Format::pts};
  ReadOptions options{
      .format = kFormats[data[0] >> 6], .threads = 1, .columns = columns_of(data[0] & 63), .skip_lines = data[1]};
  const auto* const begin = reinterpret_cast<const std::byte*>(data) + 2;
  const std::vector<std::byte> bytes(begin, begin + size - 2);
  Cloud cloud;
  if (!fuzz::accepted([&] { cloud = read(bytes, "fuzz", options); })) return 0;
  fuzz::require_same_values(cloud);
  fuzz::require(write_bytes(cloud, *options.format) == bytes);
  fuzz::accepted([&] { write_bytes(cloud, Format::ply); });
  return 0;
}
