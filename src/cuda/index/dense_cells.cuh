// SPDX-License-Identifier: Apache-2.0
// Cells of the sort keys' grid that hold very many points, as near a scanner, or of scans far apart in one cloud.
#pragma once

#include <cstddef>

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

// Puts the points of each dense cell along a Hilbert curve of 16 steps an axis over the box of their own, and so on in
// the cells of that; points within one at last in any order. `keys`: of `count` places in order,
// equal ones but for the bits below `lowest_bit`, which become 0 in such cells. `spare`: as large as `order`. Without
// such cells the keys are read once.
template <class Key, int kBits>
void order_dense_cells(Context& context, const Point* points, std::size_t count, int lowest_bit, Key* keys,
                       Index* order, Index* spare);

}  // namespace pointfair::cuda
