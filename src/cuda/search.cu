// SPDX-License-Identifier: Apache-2.0
#include "cuda/exact_group_search.cuh"
#include "cuda/group_search.cuh"
#include "cuda/search.cuh"
#include "cuda/single_search.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kGroupBlock = 64;
constexpr int kGroupWarps = kGroupBlock / kWarp;
constexpr int kFewUncertain = 7;        // up to so many queries of a leaf go to the exact search one by one,
constexpr Index kManyCandidates = 256;  // or however many with so many candidates, which one warp would be long about

// Leaves the queries of these lanes to the exact search. Their order differs from run to run; no result depends on it.
__device__ void retry(CloudState* state, Index* retries, Index at, bool wanted) {
  const unsigned all = __ballot_sync(kAllLanes, wanted);
  if (all == 0) return;
  Index first = 0;
  if (lane_number() == 0) first = atomicAdd(&state->retries, static_cast<Index>(__popc(all)));
  first = __shfl_sync(kAllLanes, first, 0);
  if (wanted) retries[first + __popc(all & lanes_below())] = at;
}
__device__ void retry_leaf(CloudState* state, Index* retries, Index leaf) {
  if (lane_number() == 0) retries[atomicAdd(&state->leaf_retries, 1u)] = leaf;
}

template <int kList>
__global__ void __launch_bounds__(kGroupBlock, kList <= 8    ? 14
                                               : kList <= 16 ? 12
                                                             : 8)
    nearest_of_leaves(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, Index* lists,
                      Retries retries) {
  __shared__ GroupMemory<kList> memory[kGroupWarps];
  const Index leaf = blockIdx.x * kGroupWarps + threadIdx.x / kWarp;
  const Index valid = state->valid;
  if (leaf >= tree.leaves) return;
  Index* list = lists + std::size_t(leaf) * query.k * kLeafSize;
  if (leaf * kLeafSize + lane_number() >= valid) {
    for (int slot = 0; slot < query.k; ++slot) list[slot * kWarp + lane_number()] = point::kNoNeighbor;
  }
  if (leaf * kLeafSize >= valid) return;
  GroupSearch<kList> search(tree, memory[threadIdx.x / kWarp], leaf, valid);
  if (search.in_one_place()) return retry_leaf(state, retries.leaves, leaf);
  bool found = false;
  if (search.suits() && search.run(query.k, query.squared_limit)) {
    found = search.certain();
    const int uncertain = __popc(__ballot_sync(kAllLanes, !found));
    if (uncertain > kFewUncertain && search.candidates() < kManyCandidates && !search.any_dropped())
      return retry_leaf(state, retries.leaves, leaf);
    search.write(query.k, query.squared_limit, list, found);
  }
  retry(state, retries.queries, search.at(), search.active() && !found);
}

template <int kList>
__global__ void __launch_bounds__(kGroupBlock)
    nearest_of_hard_leaves(const __grid_constant__ Tree tree, NearestQuery query, Index* lists, const Index* retries) {
  const Index warps = gridDim.x * kGroupWarps, count = tree.state->leaf_retries, valid = tree.state->valid;
  for (Index n = blockIdx.x * kGroupWarps + threadIdx.x / kWarp; n < count; n += warps) {
    const Index leaf = retries[n];
    ExactGroupSearch<kList> search(tree, leaf, valid);
    search.run(query.k, query.squared_limit);
    search.write(query.k, lists + std::size_t(leaf) * query.k * kLeafSize);
  }
}

extern __shared__ __align__(16) std::byte single_memory[];

__device__ SingleMemory memory_of_warp(int size) {
  return SingleMemory(single_memory + threadIdx.x / kWarp * SingleMemory::bytes(size), size);
}

// The queries that `retries` names, or all points if it is null.
__global__ void nearest_of_single(const __grid_constant__ Tree tree, NearestQuery query, int size, Index* lists,
                                  const Index* retries) {
  const Index warps = gridDim.x * (blockDim.x / kWarp);
  const Index count = retries != nullptr ? tree.state->retries : tree.state->valid;
  for (Index n = blockIdx.x * (blockDim.x / kWarp) + threadIdx.x / kWarp; n < count; n += warps) {
    const Index at = retries != nullptr ? retries[n] : n;
    const float4 p = tree.points[at];
    SingleSearch search(tree, memory_of_warp(size), position_of(p), original_of(p), query.k, query.squared_limit);
    search.run();
    Index* list = lists + std::size_t(at / kWarp) * query.k * kWarp + at % kWarp;
    for (int slot = int(lane_number()); slot < query.k; slot += kWarp)
      list[slot * kWarp] = search.key(slot) != kNoKey ? search.position(slot) : point::kNoNeighbor;
    __syncwarp();
  }
}

// Places of the last leaf that hold no valid point, where no group search fills them.
__global__ void clear_lists_beyond(const CloudState* state, Index leaves, int k, Index* lists) {
  const std::size_t valid = state->valid, all = std::size_t(leaves) * kLeafSize;
  for (std::size_t at = valid + blockIdx.x * blockDim.x + threadIdx.x; at < all; at += gridDim.x * blockDim.x)
    for (int slot = 0; slot < k; ++slot) lists[(at / kWarp * k + slot) * kWarp + at % kWarp] = point::kNoNeighbor;
}

__device__ Vec offset_from(const Tree& tree, Index at, Vec here) { return position_of(tree.points[at]) - here; }

// Grows the neighbourhood of `at` over `given` candidates (`stride` apart), reading members back from its own list.
__device__ point::ConstrainedGrowth grow(const Tree& tree, Index at, const Index* candidates, int stride, int given,
                                         bool all_given, int k, float reach, Index* list) {
  const Vec here = position_of(tree.points[at]);
  int accepted = 0;
  const point::ConstrainedGrowth growth = point::grow_constrained(
      given, k, reach, all_given, [&](int i) { return offset_from(tree, candidates[i * stride], here); },
      [&](int i) { list[accepted++ * kWarp] = candidates[i * stride]; },
      [&](int i) { return offset_from(tree, list[i * kWarp], here); });
  for (int slot = growth.accepted; slot < k; ++slot) list[slot * kWarp] = point::kNoNeighbor;
  return growth;
}

__device__ void count_short(CloudState* state, bool is_short) {
  const unsigned all = __ballot_sync(kAllLanes, is_short);
  if (all != 0 && lane_number() == 0)
    atomicAdd(&state->short_neighborhoods, static_cast<unsigned long long>(__popc(all)));
}

// Pools of up to kHeldPool candidates are fetched once, all lanes of a block side by side, and grown in shared memory.
constexpr int kGrowBlock = 64;
constexpr int kHeldPool = 32;

__device__ point::ConstrainedGrowth grow_held(const Tree& tree, Index at, const Index* candidates, int given,
                                              bool all_given, int k, float reach, Index* list) {
  __shared__ float x[kHeldPool][kGrowBlock], y[kHeldPool][kGrowBlock], z[kHeldPool][kGrowBlock];
  __shared__ unsigned char members[kHeldPool][kGrowBlock];
  const unsigned t = threadIdx.x;
  const Vec here = position_of(tree.points[at]);
#pragma unroll 8
  for (int i = 0; i < given; ++i) {
    const Vec offset = offset_from(tree, candidates[i * kWarp], here);
    x[i][t] = offset.x, y[i][t] = offset.y, z[i][t] = offset.z;
  }
  int accepted = 0;
  const point::ConstrainedGrowth growth = point::grow_constrained(
      given, k, reach, all_given,
      [&](int i) {
        return Vec{x[i][t], y[i][t], z[i][t]};
      },
      [&](int i) { members[accepted++][t] = static_cast<unsigned char>(i); },
      [&](int j) {
        return Vec{x[members[j][t]][t], y[members[j][t]][t], z[members[j][t]][t]};
      });
  for (int slot = 0; slot < k; ++slot)
    list[slot * kWarp] = slot < growth.accepted ? candidates[members[slot][t] * kWarp] : point::kNoNeighbor;
  return growth;
}

__global__ void __launch_bounds__(kGrowBlock)
    grow_all(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach, Lists pools,
             Index* lists, Index* retries) {
  const std::size_t at = std::size_t(blockIdx.x) * kGrowBlock + threadIdx.x;  // whole leaves, so whole warps
  const bool valid = at < state->valid;
  Index* list = lists + (at / kWarp * query.k) * kWarp + at % kWarp;
  point::ConstrainedGrowth growth;
  if (valid) {
    const Index* candidates = pools.of(at);
    int given = 0;
    while (given < pools.k && candidates[given * kWarp] != point::kNoNeighbor) ++given;
    const bool all_given = given < pools.k;
    growth = pools.k <= kHeldPool ? grow_held(tree, Index(at), candidates, given, all_given, query.k, reach, list)
                                  : grow(tree, Index(at), candidates, kWarp, given, all_given, query.k, reach, list);
  } else if (at < std::size_t(tree.leaves) * kLeafSize) {
    for (int slot = 0; slot < query.k; ++slot) list[slot * kWarp] = point::kNoNeighbor;
  }
  const bool again = valid && !growth.complete && pools.k < kLargestList;
  retry(state, retries, Index(at), again);
  count_short(state, valid && !again && growth.accepted < query.k);
}

// The neighbourhoods that needed more candidates than all were given: a warp finds them, its first lane grows.
__global__ void grow_retries(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach,
                             int pool, Index* lists, const Index* retries) {
  for (Index n = blockIdx.x; n < state->retries; n += gridDim.x) {
    const Index at = retries[n];
    const float4 p = tree.points[at];
    Index* list = lists + std::size_t(at / kWarp) * query.k * kWarp + at % kWarp;
    bool complete = false;
    for (int size = pool; !complete && size < kLargestList;) {
      size = min(2 * size, kLargestList);
      const SingleMemory memory = memory_of_warp(single_size(size));
      SingleSearch search(tree, memory, position_of(p), original_of(p), size, query.squared_limit);
      search.run();
      unsigned found = 0;
      for (int i = int(lane_number()); i < size; i += kWarp) found += search.key(i) != kNoKey;
      const int given = static_cast<int>(warp_sum(found));
      if (lane_number() == 0) {
        const auto growth = grow(tree, at, memory.positions, 1, given, given < size, query.k, reach, list);
        complete = growth.complete;
        if ((complete || size == kLargestList) && growth.accepted < query.k)
          atomicAdd(&state->short_neighborhoods, 1ull);
      }
      complete = __shfl_sync(kAllLanes, complete, 0);
      __syncwarp();
    }
  }
}

__global__ void mean_distances(const __grid_constant__ Tree tree, Lists lists, float* out) {
  const std::size_t at = std::size_t(blockIdx.x) * blockDim.x + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const Vec here = position_of(tree.points[at]);
  const Index* list = lists.of(at);
  float sum = 0;
  int found = 0;
  for (; found < point::kAreaNeighbors && list[found * kWarp] != point::kNoNeighbor; ++found)
    sum += point::square_root(point::squared_length(offset_from(tree, list[found * kWarp], here)));
  out[at] = point::mean_distance(sum, max(found, 1));
}

__global__ void sample(const __grid_constant__ Tree tree, const Point* points, const Index* queries, std::size_t count,
                       int k, int size, Point* rows) {
  const float nan = __int_as_float(0x7fc00000);
  for (std::size_t n = blockIdx.x; n < count; n += gridDim.x) {
    const Point p = points[queries[n]];
    Point* row = rows + n * (std::size_t(k) + 1);
    const bool valid = point::is_indexable(p.x, p.y, p.z);
    SingleSearch search(tree, memory_of_warp(size), {p.x, p.y, p.z}, queries[n], k, __int_as_float(0x7f800000));
    if (valid) search.run();
    for (int slot = int(lane_number()); slot < k; slot += kWarp) {
      const bool real = valid && search.key(slot) != kNoKey;
      const float4 q = real ? tree.points[search.position(slot)] : float4{nan, nan, nan, 0};
      row[slot + 1] = {q.x, q.y, q.z};
    }
    if (lane_number() == 0) row[0] = valid ? p : Point{nan, nan, nan};
    __syncwarp();
  }
}

// Blocks of single searches: as many warps as shared memory lets a block have, at most 4.
struct SingleLaunch {
  int size, threads;
  std::size_t bytes;
};
template <class Kernel>
SingleLaunch prepare_single(Kernel kernel, int k, int most_warps) {
  const int size = single_size(k);
  const int warps = size <= 256 ? most_warps : 1;
  const std::size_t bytes = warps * SingleMemory::bytes(size);
  check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, int(bytes)),
        "preparing the exact search");
  return {size, warps * kWarp, bytes};
}

template <int kList>
void launch_group_search(Context& context, const Tree& tree, CloudState* state, NearestQuery query, Index* list,
                         Retries retries) {
  nearest_of_leaves<kList>
      <<<blocks_for(tree.leaves, kGroupWarps), kGroupBlock, 0, context.stream()>>>(tree, state, query, list, retries);
  check(cudaGetLastError(), "searching neighbours");
  nearest_of_hard_leaves<kList><<<std::min(blocks_for(tree.leaves, kGroupWarps), unsigned(context.processors()) * 12),
                                  kGroupBlock, 0, context.stream()>>>(tree, query, list, retries.leaves);
  check(cudaGetLastError(), "searching neighbours of hard leaves");
}

}  // namespace

void find_nearest(Context& context, const Tree& tree, CloudState* state, NearestQuery query, Index* list,
                  Retries retries) {
  const cudaStream_t stream = context.stream();
  const bool grouped = query.k <= kLargestGroupList;
  if (grouped) {
    static_assert(offsetof(CloudState, retries) == offsetof(CloudState, leaf_retries) + sizeof(Index));
    check(cudaMemsetAsync(&state->leaf_retries, 0, 2 * sizeof(Index), stream), "preparing the search");
    const auto launch = query.k <= 8    ? launch_group_search<8>
                        : query.k <= 16 ? launch_group_search<16>
                                        : launch_group_search<32>;
    launch(context, tree, state, query, list, retries);
  } else {
    clear_lists_beyond<<<context.processors(), 256, 0, stream>>>(state, tree.leaves, query.k, list);
    check(cudaGetLastError(), "preparing the search");
  }
  const SingleLaunch single = prepare_single(nearest_of_single, query.k, 4);
  const unsigned blocks = unsigned(context.processors()) * 16;
  nearest_of_single<<<blocks, single.threads, single.bytes, stream>>>(tree, query, single.size, list,
                                                                      grouped ? retries.queries : nullptr);
  check(cudaGetLastError(), "searching neighbours exactly");
}

void grow_neighborhoods(Context& context, const Tree& tree, CloudState* state, NearestQuery query, float reach,
                        Lists candidates, Index* list, Index* retries) {
  const cudaStream_t stream = context.stream();
  check(cudaMemsetAsync(&state->retries, 0, sizeof(Index), stream), "preparing constrained neighbourhoods");
  grow_all<<<blocks_for(tree.leaves, kGrowBlock / kWarp), kGrowBlock, 0, stream>>>(tree, state, query, reach,
                                                                                   candidates, list, retries);
  check(cudaGetLastError(), "growing constrained neighbourhoods");
  const SingleLaunch single = prepare_single(grow_retries, kLargestList, 1);
  grow_retries<<<unsigned(context.processors()) * 4, single.threads, single.bytes, stream>>>(
      tree, state, query, reach, candidates.k, list, retries);
  check(cudaGetLastError(), "growing constrained neighbourhoods");
}

void measure_mean_distances(Context& context, const Tree& tree, Lists lists, float* mean_distance) {
  mean_distances<<<blocks_for(tree.leaves, 4), 4 * kWarp, 0, context.stream()>>>(tree, lists, mean_distance);
  check(cudaGetLastError(), "measuring mean distances");
}

void sample_nearest(Context& context, const Tree& tree, const Point* points, const Index* queries, std::size_t count,
                    int k, Point* rows) {
  const SingleLaunch single = prepare_single(sample, k, 1);
  const unsigned blocks = std::min(blocks_for(count, 1), unsigned(context.processors()) * 16);
  sample<<<blocks, single.threads, single.bytes, context.stream()>>>(tree, points, queries, count, k, single.size,
                                                                     rows);
  check(cudaGetLastError(), "sampling neighbourhoods");
}

}  // namespace pointfair::cuda
