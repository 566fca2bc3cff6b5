// SPDX-License-Identifier: Apache-2.0
// What is made of the nearest points: constrained neighbourhoods, and mean distances for the area weight.
#include "cuda/search/retries.cuh"
#include "cuda/search/search.cuh"
#include "cuda/search/single_search.cuh"

namespace pointfair::cuda {
namespace {

__device__ Vec offset_from(const Tree& tree, Index at, Vec here) { return position_of(tree.points[at]) - here; }

// Grows the neighbourhood of `at` over the `given` candidates that candidate(i) names, reading members back from its
// own list.
template <class Candidate>
__device__ point::ConstrainedGrowth grow(const Tree& tree, Index at, Candidate candidate, int given, bool all_given,
                                         int k, float reach, Index* list) {
  const Vec here = position_of(tree.points[at]);
  int accepted = 0;
  const point::ConstrainedGrowth growth = point::grow_constrained(
      given, k, reach, all_given, [&](int i) { return offset_from(tree, candidate(i), here); },
      [&](int i) { list[accepted++ * kWarp] = candidate(i); },
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
  look.mean_distance = point::mean_distance(sum, float(max(summed, 1)));
  return look;
}

__global__ void __launch_bounds__(kGrowBlock)
    grow_all(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach, Lists pools,
             Index* lists, Index* retries, float* mean_distance) {
  const std::size_t at = std::size_t(blockIdx.x) * kGrowBlock + threadIdx.x;  // whole leaves, so whole warps
  const bool exists = at < std::size_t(tree.leaves) * kLeafSize, valid = exists && tree.holds(at);
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
      growth = grow(
          tree, Index(at), [&](int i) { return candidates[i * kWarp]; }, look.given, all_given, query.k, reach, list);
    }
  } else if (exists) {
    for (int slot = 0; slot < query.k; ++slot) list[slot * kWarp] = point::kNoNeighbor;
  }
  if (exists && mean_distance != nullptr) mean_distance[at] = look.mean_distance;
  const bool again = valid && !growth.complete && pools.k < kLargestList;
  retry(state, retries, Index(at), again);
  count_short(state, valid && !again && growth.accepted < query.k);
}

// point::grow_constrained for k <= 32 by a warp: a lane to each member, so all are asked at once whether a candidate
// joins. `position_of_candidate(i)` is called by all lanes, each for its own i below `given`. The members are left in
// `member`, a lane each.
template <class PositionOfCandidate>
__device__ point::ConstrainedGrowth grow_by_warp(const Tree& tree, Vec here, int given, bool all_given, int k,
                                                 float reach, PositionOfCandidate position_of_candidate,
                                                 Index& member) {
  const float squared_reach = reach * reach;
  const int lane = static_cast<int>(lane_number());
  point::ConstrainedGrowth growth;
  Vec member_offset = {};
  float last = 0, farthest = 0;
  for (int first = 0; first < given && growth.accepted < k; first += kWarp) {
    const Index position = first + lane < given ? position_of_candidate(first + lane) : point::kNoNeighbor;
    const Vec offset = position != point::kNoNeighbor ? offset_from(tree, position, here) : Vec{};
    for (int i = 0; first + i < given && i < kWarp && growth.accepted < k; ++i) {
      const Vec q = {__shfl_sync(kAllLanes, offset.x, i), __shfl_sync(kAllLanes, offset.y, i),
                     __shfl_sync(kAllLanes, offset.z, i)};
      const Index candidate = __shfl_sync(kAllLanes, position, i);
      last = point::squared_length(q);
      const bool near = lane < growth.accepted && point::squared_length(q - member_offset) < squared_reach;
      if (!__any_sync(kAllLanes, near || last < squared_reach)) continue;
      if (lane == growth.accepted) member = candidate, member_offset = q;
      ++growth.accepted;
      farthest = last;
    }
  }
  growth.complete =
      growth.accepted == k || all_given || point::square_root(last) >= point::square_root(farthest) + reach;
  return growth;
}

// Writes the members, and what a list of k has beyond them.
__device__ void write_members(const point::ConstrainedGrowth& growth, Index member, int k, Index* list) {
  const int lane = static_cast<int>(lane_number());
  if (lane < k) list[lane * kWarp] = lane < growth.accepted ? member : point::kNoNeighbor;
}

// Neighbourhoods that needed more candidates than all were given: over the 32 nearest. Of `retries` those are left that
// need more still.
constexpr int kRetryBlock = 64;
constexpr int kRetryBlocks = 20;  // of a processor

__global__ void __launch_bounds__(kRetryBlock, resident_blocks(kRetryBlocks, kRetryBlock))
    grow_over_few(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach, Index* lists,
                  Index* retries, const __grid_constant__ Stop stop) {
  __shared__ SingleWalk walks[kRetryBlock / kWarp];
  const Index warp = threadIdx.x / kWarp, warps = gridDim.x * (kRetryBlock / kWarp);
  for (Index n = blockIdx.x * (kRetryBlock / kWarp) + warp; n < state->retries; n += warps) {
    if (stop.is_heard(n)) return;
    const Index at = retries[n];
    const float4 p = tree.points[at];
    Index* list = lists + std::size_t(at / kWarp) * query.k * kWarp + at % kWarp;
    RegisterList nearest(tree.points);
    SingleSearch<RegisterList>(tree, walks[warp], nearest, position_of(p), original_of(p), kWarp, query.squared_limit)
        .run();
    Index candidate = point::kNoNeighbor, member = 0;
    nearest.for_each(kWarp, [&](int, Key key) { candidate = point::key_index(key); });
    const int given = __popc(__ballot_sync(kAllLanes, candidate != point::kNoNeighbor));
    const point::ConstrainedGrowth growth = grow_by_warp(
        tree, position_of(p), given, given < kWarp, query.k, reach, [&](int) { return candidate; }, member);
    write_members(growth, member, query.k, list);
    if (growth.complete && lane_number() == 0) {
      retries[n] = point::kNoNeighbor;
      if (growth.accepted < query.k) atomicAdd(&state->short_neighborhoods, 1ull);
    }
    __syncwarp();
  }
}

extern __shared__ __align__(16) std::byte candidate_memory[];

// What is left of `retries`: over twice as many as `pool`, and so on.
__global__ void grow_over_many(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, float reach,
                               int pool, Index* lists, const Index* retries, const __grid_constant__ Stop stop) {
  __shared__ SingleWalk walk;
  for (Index n = blockIdx.x; n < state->retries; n += gridDim.x) {
    const Index at = retries[n];
    if (at == point::kNoNeighbor) continue;
    if (stop.is_heard(n)) return;
    const float4 p = tree.points[at];
    Index* list = lists + std::size_t(at / kWarp) * query.k * kWarp + at % kWarp;
    bool complete = false;
    for (int size = pool; !complete && size < kLargestList;) {
      size = min(2 * size, kLargestList);
      SharedList nearest(tree.points, candidate_memory, SharedList::size_for(size));
      SingleSearch<SharedList>(tree, walk, nearest, position_of(p), original_of(p), size, query.squared_limit).run();
      unsigned found = 0;
      nearest.for_each(size, [&](int, Key key) { found += key != kNoKey; });
      const int given = static_cast<int>(warp_sum(found));
      const bool all_given = given < size;
      const auto candidate = [&](int i) { return point::key_index(nearest.key(i)); };
      point::ConstrainedGrowth growth;
      if (query.k <= kWarp) {
        Index member = 0;
        growth = grow_by_warp(tree, position_of(p), given, all_given, query.k, reach, candidate, member);
        write_members(growth, member, query.k, list);
      } else if (lane_number() == 0) {
        growth = grow(tree, at, candidate, given, all_given, query.k, reach, list);
      }
      complete = __shfl_sync(kAllLanes, growth.complete, 0);
      if (lane_number() == 0 && (complete || size == kLargestList) && growth.accepted < query.k)
        atomicAdd(&state->short_neighborhoods, 1ull);
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
  out[at] = point::mean_distance(sum, float(max(found, 1)));
}

}  // namespace

void grow_neighborhoods(Context& context, const Tree& tree, CloudState* state, NearestQuery query, float reach,
                        Lists candidates, Index* list, Index* retries, float* mean_distance, const Stop& stop) {
  const cudaStream_t stream = context.stream();
  check(cudaMemsetAsync(&state->retries, 0, sizeof(Index), stream), "preparing constrained neighbourhoods");
  launch(context, "growing constrained neighbourhoods", grow_all, blocks_for(tree.leaves, kGrowBlock / kWarp),
         kGrowBlock, tree, state, query, reach, candidates, list, retries, mean_distance);
  const unsigned processors = unsigned(context.processors());
  const bool few = candidates.k < kWarp;
  if (few) {
    launch(context, "growing constrained neighbourhoods", grow_over_few, processors * kRetryBlocks, kRetryBlock, tree,
           state, query, reach, list, retries, stop);
  }
  const std::size_t bytes = allow_list_memory(grow_over_many, 1, kLargestList);
  grow_over_many<<<processors * 8, kWarp, bytes, stream>>>(tree, state, query, reach, few ? kWarp : candidates.k, list,
                                                           retries, stop);
  check(cudaGetLastError(), "growing constrained neighbourhoods");
}

void measure_mean_distances(Context& context, const Tree& tree, Lists lists, float* mean_distance) {
  launch(context, "measuring mean distances", mean_distances, blocks_for(tree.leaves, 4), 4 * kWarp, tree, lists,
         mean_distance);
}

}  // namespace pointfair::cuda
