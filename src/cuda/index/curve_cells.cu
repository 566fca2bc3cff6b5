// SPDX-License-Identifier: Apache-2.0
#include "cuda/index/curve_cells.cuh"
#include "cuda/index/sort_keys.cuh"
#include "cuda/runtime/launch.cuh"
#include "cuda/runtime/network.cuh"

namespace pointfair::cuda {
namespace {

using CurveKey = std::uint64_t;
constexpr int kBlock = 256;
constexpr int kLongBlock = 512;
constexpr int kMostAlone = 32;  // points of a cell that one thread puts in order; longer ones get a block each

__device__ Vec position_at(const Point* points, Index index) {
  const Point p = points[index];
  return {p.x, p.y, p.z};
}

// By insertion, identical points as they are.
__device__ void order_short_cell(const Point* points, Index* order, int count) {
  for (int n = 1; n < count; ++n) {
    const Index index = order[n];
    const Vec place = position_at(points, index);
    int to = n;
    for (; to > 0 && point::lies_before(place, position_at(points, order[to - 1])); --to) order[to] = order[to - 1];
    order[to] = index;
  }
}

__global__ void __launch_bounds__(kBlock)
    order_short_cells(const Point* points, const CurveKey* keys, std::size_t count, Index* order, CloudState* state,
                      Index* long_cells) {
  begin_kernel();
  const std::size_t first = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (first + 1 >= count) return;
  const CurveKey key = keys[first];
  const bool begins = keys[first + 1] == key && (first == 0 || keys[first - 1] != key);
  if (!begins || key == kInvalid<CurveKey, kCurveBits>) return;
  int length = 2;
  while (length <= kMostAlone && first + length < count && keys[first + length] == key) ++length;
  if (length > kMostAlone) {
    long_cells[atomicAdd(&state->long_cells, 1u)] = static_cast<Index>(first);
  } else {
    order_short_cell(points, order + first, length);
  }
}

// The end of the cell of `key` that begins at `first`.
__device__ std::size_t end_of_cell(const CurveKey* keys, std::size_t first, std::size_t count) {
  const CurveKey key = keys[first];
  std::size_t end = count;
  while (first < end) {
    const std::size_t middle = first + (end - first) / 2;
    if (keys[middle] == key) {
      first = middle + 1;
    } else {
      end = middle;
    }
  }
  return end;
}

// Whether the cell's n-th point comes before its m-th; identical points by index, since a network would not leave them
// as they are.
struct CellOrder {
  const Point* points;
  const Index* order;
  __device__ bool operator()(std::size_t n, std::size_t m) const {
    const Index a = order[n], b = order[m];
    const Vec p = position_at(points, a), q = position_at(points, b);
    return point::lies_before(p, q) || (!point::lies_before(q, p) && a < b);
  }
};

__device__ void order_long_cell(const Point* points, Index* order, std::size_t count) {
  const CellOrder precedes{points, order};
  bool in_order = true;
  for (std::size_t n = threadIdx.x; n + 1 < count && in_order; n += kLongBlock) in_order = !precedes(n + 1, n);
  if (__syncthreads_and(in_order) != 0) return;
  sort_by_block(count, kLongBlock, [&](std::size_t i, std::size_t j) {
    if (!precedes(j, i)) return;
    const Index index = order[i];
    order[i] = order[j];
    order[j] = index;
  });
}

// A block to each cell, so that even all points in one take no time that grows with their square.
__global__ void __launch_bounds__(kLongBlock)
    order_long_cells(const Point* points, const CurveKey* keys, std::size_t count, Index* order,
                     const CloudState* state, const Index* long_cells) {
  begin_kernel();
  for (Index n = blockIdx.x; n < state->long_cells; n += gridDim.x) {
    const std::size_t first = long_cells[n];
    order_long_cell(points, order + first, end_of_cell(keys, first, count) - first);
  }
}

}  // namespace

void order_cells(Context& context, const Point* points, const std::uint64_t* keys, std::size_t count, Index* order,
                 CloudState* state, Index* spare) {
  launch_early(context, "ordering cells of the curve", order_short_cells, blocks_for(count, kBlock), kBlock, points,
               keys, count, order, state, spare);
  launch_early(context, "ordering cells of the curve", order_long_cells, unsigned(context.processors()), kLongBlock,
               points, keys, count, static_cast<Index*>(order), static_cast<const CloudState*>(state),
               static_cast<const Index*>(spare));
}

}  // namespace pointfair::cuda
