// SPDX-License-Identifier: Apache-2.0
// The one parallel loop of the CPU backend: blocks of fixed size, so that what a block computes never depends on the
// number of threads, with a look at the stop token before each.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <stop_token>

#include "pointfair/cloud.hpp"
#include "seam/stop.hpp"

namespace pointfair::cpu {

// Calls body(first, last, block) for consecutive blocks of `block_size` items.
template <class Body>
void for_blocks(std::size_t items, std::size_t block_size, const std::stop_token& stop, const Body& body) {
  const std::size_t blocks = (items + block_size - 1) / block_size;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks, 1), [&](const tbb::blocked_range<std::size_t>& range) {
    for (std::size_t block = range.begin(); block != range.end(); ++block) {
      throw_if_stopped(stop);
      body(block * block_size, std::min(items, (block + 1) * block_size), block);
    }
  });
}

// Calls body(item) for each, a block's one after the other.
template <class Body>
void for_items(std::size_t items, std::size_t block_size, const std::stop_token& stop, const Body& body) {
  for_blocks(items, block_size, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t i = first; i < last; ++i) body(i);
  });
}

}  // namespace pointfair::cpu
