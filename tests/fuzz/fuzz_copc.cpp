// SPDX-License-Identifier: Apache-2.0
// LAS files, written as COPC: whatever the records hold, the octree has each point once, where it was.
#include <algorithm>

#include "fuzz_reader.h"
#include "io/source.hpp"

namespace {

using namespace pointfair;

// In the order of their coordinates.
std::vector<Position> sorted_positions(const Cloud& cloud) {
  std::vector<Position> all;
  for (std::size_t block = 0; block < cloud.source->block_count(); ++block) {
    std::vector<Position> some(cloud.source->block_size(block));
    cloud.source->positions(block, some);
    all.insert(all.end(), some.begin(), some.end());
  }
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto* const begin = reinterpret_cast<const std::byte*>(data);
  fuzz::accepted([&] {
    const Cloud cloud = fuzz::read_as({begin, begin + size}, Format::las);
    const auto octree = write_bytes(cloud, Format::copc);
    // what is written is read, without fail
    fuzz::require(sorted_positions(fuzz::read_as(octree, Format::laz)) == sorted_positions(cloud));
  });
  return 0;
}
