// SPDX-License-Identifier: Apache-2.0
// Points that share a cell of the curve of src/point/curve.h (src/point/curve.h), by position.
#pragma once

#include <cstdint>

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

// Puts the points of each cell in the order of point::lies_before, identical ones by index. `keys`: of `count` sorted
// points, equal in one cell, kInvalid for those that have none; `order`: their indices in `points`; `spare`: room for
// count / 32 indices. state->long_cells must be 0. Cells mostly hold one point, or identical ones, and cost nothing.
void order_cells(Context& context, const Point* points, const std::uint64_t* keys, std::size_t count, Index* order,
                 CloudState* state, Index* spare);

}  // namespace pointfair::cuda
