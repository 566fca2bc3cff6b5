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
constexpr int kHeldPool = 16;

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

// What one look at all candidates tells.
struct Look {
  int given = 0;
  bool all_near = true;  // the first k are within reach of the point itself, so they are its neighbourhood
  float mean_distance = 0;
};

__device__ __forceinline__ Look look_at(const Tree& tree, Index at, const Index* candidates, int pool, int k,
                                        float reach) {
  const Vec here = position_of(tree.points[at]);
  const float squared_reach = reach * reach;
  Look look;
  float sum = 0;
  int summed = 0;
#pragma unroll 8
  for (int i = 0; i < pool; ++i) {
    const Index candidate = candidates[i * kWarp];
    const bool exists = candidate != point::kNoNeighbor;
    const float distance = point::squared_length(offset_from(tree, exists ? candidate : at, here));
    look.given += exists;
    look.all_near &= i >= k || (exists && distance < squared_reach);
    if (i >= point::kAreaNeighbors || !exists) continue;
    sum += point::square_root(distance);
    ++summed;
  }
  look.mean_distance = point::mean_distance(sum, max(summed, 1));
  return look;
}

__global__ void __launch_bounds__(kGrowBlock)
    grow_all(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach, Lists pools,
             Index* lists, Index* retries, float* mean_distance) {
  const std::size_t at = std::size_t(blockIdx.x) * kGrowBlock + threadIdx.x;  // whole leaves, so whole warps
  const bool valid = at < state->valid, exists = at < std::size_t(tree.leaves) * kLeafSize;
  Index* list = lists + (at / kWarp * query.k) * kWarp + at % kWarp;
  point::ConstrainedGrowth growth;
  Look look;
  if (valid) {
    const Index* candidates = pools.of(at);
    look = look_at(tree, Index(at), candidates, pools.k, query.k, reach);
    const bool all_given = look.given < pools.k;
    if (look.all_near) {
      for (int slot = 0; slot < query.k; ++slot) list[slot * kWarp] = candidates[slot * kWarp];
      growth.accepted = query.k;
    } else if (pools.k <= kHeldPool) {
      growth = grow_held(tree, Index(at), candidates, look.given, all_given, query.k, reach, list);
    } else {
      growth = grow(tree, Index(at), candidates, kWarp, look.given, all_given, query.k, reach, list);
    }
  } else if (exists) {
    for (int slot = 0; slot < query.k; ++slot) list[slot * kWarp] = point::kNoNeighbor;
  }
  if (exists && mean_distance != nullptr) mean_distance[at] = look.mean_distance;
  const bool again = valid && !growth.complete && pools.k < kLargestList;
  retry(state, retries, Index(at), again);
  count_short(state, valid && !again && growth.accepted < query.k);
}

// point::grow_constrained over up to 32 candidates, a lane to each, nearest first: all members are asked at once
// whether a candidate joins.
__device__ point::ConstrainedGrowth grow_over_lanes(Vec mine, bool given, bool all_given, int k, float reach,
                                                    unsigned& members) {
  const float squared_reach = reach * reach, distance = point::squared_length(mine);
  const int count = __popc(__ballot_sync(kAllLanes, given));
  point::ConstrainedGrowth growth;
  float last = 0, farthest = 0;
  members = 0;
  for (int i = 0; i < count && growth.accepted < k; ++i) {
    const Vec q = {__shfl_sync(kAllLanes, mine.x, i), __shfl_sync(kAllLanes, mine.y, i),
                   __shfl_sync(kAllLanes, mine.z, i)};
    last = __shfl_sync(kAllLanes, distance, i);
    const bool member = (members >> lane_number() & 1u) != 0;
    const bool joins = last < squared_reach || (member && point::squared_length(q - mine) < squared_reach);
    if (!__any_sync(kAllLanes, joins)) continue;
    members |= 1u << i;
    ++growth.accepted;
    farthest = last;
  }
  growth.complete =
      growth.accepted == k || all_given || point::square_root(last) >= point::square_root(farthest) + reach;
  return growth;
}

extern __shared__ __align__(16) std::byte candidate_memory[];

// One neighbourhood that needed more candidates than all were given: over the 32 nearest, then over twice as many, and
// so on.
__device__ point::ConstrainedGrowth grow_retry(const Tree& tree, SingleWalk& walk, NearestQuery query, float reach,
                                               int pool, Index at, Index* list) {
  const float4 p = tree.points[at];
  const Vec here = position_of(p);
  point::ConstrainedGrowth growth;
  if (pool < kWarp) {
    RegisterList nearest;
    SingleSearch<RegisterList>(tree, walk, nearest, here, original_of(p), kWarp, query.squared_limit).run();
    bool given = false;
    Index position = 0;
    nearest.for_each(kWarp, [&](int, Key key, Index found) { given = key != kNoKey, position = found; });
    const Vec mine = given ? offset_from(tree, position, here) : Vec{};
    unsigned members = 0;
    growth = grow_over_lanes(mine, given, !__all_sync(kAllLanes, given), query.k, reach, members);
    if ((members >> lane_number() & 1u) != 0) list[__popc(members & lanes_below()) * kWarp] = position;
    if (static_cast<int>(lane_number()) >= growth.accepted && static_cast<int>(lane_number()) < query.k)
      list[lane_number() * kWarp] = point::kNoNeighbor;
    if (growth.complete) return growth;
    __syncwarp();
    pool = kWarp;
  }
  for (bool complete = false; !complete && pool < kLargestList;) {
    pool = min(2 * pool, kLargestList);
    SharedList nearest(candidate_memory, SharedList::size_for(pool));
    SingleSearch<SharedList>(tree, walk, nearest, here, original_of(p), pool, query.squared_limit).run();
    unsigned found = 0;
    nearest.for_each(pool, [&](int, Key key, Index) { found += key != kNoKey; });
    const int given = static_cast<int>(warp_sum(found));
    if (lane_number() == 0) growth = grow(tree, at, nearest.positions(), 1, given, given < pool, query.k, reach, list);
    complete = __shfl_sync(kAllLanes, growth.complete, 0);
    __syncwarp();
  }
  return growth;
}

__global__ void grow_retries(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach,
                             int pool, Index* lists, const Index* retries) {
  __shared__ SingleWalk walk;
  for (Index n = blockIdx.x; n < state->retries; n += gridDim.x) {
    const Index at = retries[n];
    Index* list = lists + std::size_t(at / kWarp) * query.k * kWarp + at % kWarp;
    const point::ConstrainedGrowth growth = grow_retry(tree, walk, query, reach, pool, at, list);
    if (lane_number() == 0 && growth.accepted < query.k) atomicAdd(&state->short_neighborhoods, 1ull);
    __syncwarp();
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
  out[at] = point::mean_distance(sum, float(max(found, 1)));
}

}  // namespace

void grow_neighborhoods(Context& context, const Tree& tree, CloudState* state, NearestQuery query, float reach,
                        Lists candidates, Index* list, Index* retries, float* mean_distance) {
  const cudaStream_t stream = context.stream();
  check(cudaMemsetAsync(&state->retries, 0, sizeof(Index), stream), "preparing constrained neighbourhoods");
  grow_all<<<blocks_for(tree.leaves, kGrowBlock / kWarp), kGrowBlock, 0, stream>>>(
      tree, state, query, reach, candidates, list, retries, mean_distance);
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
