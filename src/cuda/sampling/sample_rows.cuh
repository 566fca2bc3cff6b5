// SPDX-License-Identifier: Apache-2.0
// The nearest points of some samples of a cloud, as rows of points.
#pragma once

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

inline constexpr int kLargestRow = 1024;

// Rows of k + 1 points, k <= kLargestRow: the query and its k nearest others, or every `stride`-th of its k * stride
// nearest, as far as kLargestRow goes; NaN where there is none. `queries` in upload order; the row of kNoNeighbor, of
// more than 32 neighbours, is not written.
struct RowRequest {
  const Index* queries;
  std::size_t count;
  int k;
  Point* rows;
  const Point* known = nullptr;  // rows of the same queries and stride with fewer neighbours, if there are
  int known_k = 0;
  const Index* clouds = nullptr;  // of each query, in a batch
  int stride = 1;

  __host__ __device__ int nearest() const { return k * stride < kLargestRow ? k * stride : kLargestRow; }
};

// Starts to fill rows; `points` in upload order.
void find_rows(Context& context, const Tree& tree, const Point* points, const RowRequest& request);
// Both at once, of up to 32 neighbours and of more.
void find_rows(Context& context, const Tree& tree, const Point* points, const RowRequest& few, const RowRequest& many);

}  // namespace pointfair::cuda
