// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/launch.cuh"
#include "cuda/sampling/sample_rows.cuh"
#include "cuda/search/block_search.cuh"
#include "cuda/search/single_search.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / kWarp;

using Search = BlockSearch<kBlock>;
static_assert(Search::kLargest == kLargestRow);
union SearchMemory {
  Search::Memory block;
  SingleWalk walks[kWarps];
};

__device__ Point no_point() {
  const float nan = __int_as_float(0x7fc00000);
  return {nan, nan, nan};
}
__device__ Point point_of(const Tree& tree, Key key) {
  if (key == kNoKey) return no_point();
  const Vec p = position_of(tree.points[point::key_index(key)]);
  return {p.x, p.y, p.z};
}

__device__ Index root_of(const RowRequest& request, std::size_t n) {
  return request.clouds == nullptr ? 0 : request.clouds[n];
}

__device__ void fill_row_by_block(const Tree& tree, const Point* points, const RowRequest& request, std::size_t n,
                                  Search::Memory& memory) {
  const Index query = request.queries[n];
  if (query == point::kNoNeighbor) return;
  const int k = request.k, known_k = request.known_k, stride = request.stride, nearest = request.nearest();
  const Point p = points[query];
  const bool exists = point::is_indexable(p);
  if (exists) {
    const Vec position = {p.x, p.y, p.z};
    Search search(tree, root_of(request, n), memory, position, query, nearest);
    const Point last = request.known == nullptr ? no_point() : request.known[(n + 1) * (std::size_t(known_k) + 1) - 1];
    search.run(last.x == last.x ? search.scaled(point::squared_length(Vec{last.x, last.y, last.z} - position),
                                                static_cast<float>(known_k * stride))
                                : search.guess());
  }
  Point* const row = request.rows + n * (std::size_t(k) + 1);
  if (threadIdx.x == 0) row[0] = exists ? p : no_point();
  for (int place = static_cast<int>(threadIdx.x), at = stride * place + stride - 1; place < k;
       place += kBlock, at += stride * kBlock)
    row[place + 1] = exists && at < nearest ? point_of(tree, memory.keys[at]) : no_point();
}

__device__ void fill_row_by_warp(const Tree& tree, const Point* points, const RowRequest& request, std::size_t n,
                                 SingleWalk& walk) {
  const Index query = request.queries[n];
  const Point p = points[query];
  RegisterList list(tree.points);
  if (point::is_indexable(p))
    SingleSearch<RegisterList>(tree, walk, list, {p.x, p.y, p.z}, query, request.k, __int_as_float(0x7f800000))
        .run(root_of(request, n));
  Point* const row = request.rows + n * (std::size_t(request.k) + 1);
  if (lane_number() == 0) row[0] = point::is_indexable(p) ? p : no_point();
  list.for_each(request.k, [&](int place, Key key) { row[place + 1] = point_of(tree, key); });
}

// A block to each query for many neighbours, then a warp to each for few.
__global__ void __launch_bounds__(kBlock)
    fill_rows(const __grid_constant__ Tree tree, const Point* points, const RowRequest few, const RowRequest many) {
  __shared__ SearchMemory memory;
  begin_kernel();
  const std::size_t block = blockIdx.x, warp = threadIdx.x / kWarp;
  if (block < many.count) return fill_row_by_block(tree, points, many, block, memory.block);
  const std::size_t n = (block - many.count) * kWarps + warp;
  if (n < few.count) fill_row_by_warp(tree, points, few, n, memory.walks[warp]);
}

}  // namespace

void find_rows(Context& context, const Tree& tree, const Point* points, const RowRequest& few, const RowRequest& many) {
  const std::size_t blocks = many.count + (few.count + kWarps - 1) / kWarps;
  if (blocks > 0)
    launch_early(context, "finding rows", fill_rows, static_cast<unsigned>(blocks), kBlock, tree, points, few, many);
}

void find_rows(Context& context, const Tree& tree, const Point* points, const RowRequest& request) {
  const bool is_few = request.nearest() <= RegisterList::kCapacity && request.stride == 1;
  find_rows(context, tree, points, is_few ? request : RowRequest{}, is_few ? RowRequest{} : request);
}

}  // namespace pointfair::cuda
