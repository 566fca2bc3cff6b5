// SPDX-License-Identifier: Apache-2.0
#include "seam/host_copy.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace pointfair {

void copy_by_all_threads(std::span<const Point> from, Point* to) {
  constexpr std::size_t kBlock = 1 << 12;  // points
  tbb::parallel_for(std::size_t(0), (from.size() + kBlock - 1) / kBlock, [&](std::size_t block) {
    const std::size_t begin = block * kBlock;
    std::ranges::copy(from.subspan(begin, std::min(kBlock, from.size() - begin)), to + begin);
  });
}

}  // namespace pointfair
