// SPDX-License-Identifier: Apache-2.0
// What is made of the nearest points: constrained neighbourhoods, and mean distances for the area weight.
#include "cuda/retries.cuh"
#include "cuda/search.cuh"
#include "cuda/single_search.cuh"

namespace pointfair::cuda {
namespace {

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

extern __shared__ __align__(16) std::byte candidate_memory[];

// The neighbourhoods that needed more candidates than all were given: a warp finds them, its first lane grows.
__global__ void grow_retries(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach,
                             int pool, Index* lists, const Index* retries) {
  __shared__ SingleWalk walk;
  for (Index n = blockIdx.x; n < state->retries; n += gridDim.x) {
    const Index at = retries[n];
    const float4 p = tree.points[at];
    Index* list = lists + std::size_t(at / kWarp) * query.k * kWarp + at % kWarp;
    bool complete = false;
    for (int size = pool; !complete && size < kLargestList;) {
      size = min(2 * size, kLargestList);
      SharedList nearest(candidate_memory, SharedList::size_for(size));
      SingleSearch<SharedList>(tree, walk, nearest, position_of(p), original_of(p), size, query.squared_limit).run();
      unsigned found = 0;
      nearest.for_each(size, [&](int, Key key, Index) { found += key != kNoKey; });
      const int given = static_cast<int>(warp_sum(found));
      if (lane_number() == 0) {
        const auto growth = grow(tree, at, nearest.positions(), 1, given, given < size, query.k, reach, list);
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

}  // namespace

void grow_neighborhoods(Context& context, const Tree& tree, CloudState* state, NearestQuery query, float reach,
                        Lists candidates, Index* list, Index* retries) {
  const cudaStream_t stream = context.stream();
  check(cudaMemsetAsync(&state->retries, 0, sizeof(Index), stream), "preparing constrained neighbourhoods");
  grow_all<<<blocks_for(tree.leaves, kGrowBlock / kWarp), kGrowBlock, 0, stream>>>(tree, state, query, reach,
                                                                                   candidates, list, retries);
  check(cudaGetLastError(), "growing constrained neighbourhoods");
  const std::size_t bytes = allow_list_memory(grow_retries, 1, kLargestList);
  grow_retries<<<unsigned(context.processors()) * 8, kWarp, bytes, stream>>>(tree, state, query, reach, candidates.k,
                                                                             list, retries);
  check(cudaGetLastError(), "growing constrained neighbourhoods");
}

void measure_mean_distances(Context& context, const Tree& tree, Lists lists, float* mean_distance) {
  mean_distances<<<blocks_for(tree.leaves, 4), 4 * kWarp, 0, context.stream()>>>(tree, lists, mean_distance);
  check(cudaGetLastError(), "measuring mean distances");
}

}  // namespace pointfair::cuda
