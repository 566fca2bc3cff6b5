// SPDX-License-Identifier: Apache-2.0
// Sums over all points whose order never depends on the number of threads: of blocks of fixed size, then of those.
#pragma once

#include <cstddef>
#include <stop_token>
#include <vector>

#include "cpu/parallel.h"
#include "point/graph.h"

namespace pointfair::cpu {

inline constexpr std::size_t kSumBlock = point::kSumBlock;

// Calls add(item, sum of its block) for each item; a Sum begins with its default value and has +=.
template <class Sum, class Add>
Sum ordered_sum(std::size_t items, const std::stop_token& stop, const Add& add) {
  std::vector<Sum> sums((items + kSumBlock - 1) / kSumBlock);
  for_blocks(items, kSumBlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    Sum here{};
    for (std::size_t i = first; i < last; ++i) add(i, here);
    sums[block] = here;
  });
  Sum all{};
  for (const Sum& sum : sums) all += sum;
  return all;
}

}  // namespace pointfair::cpu
