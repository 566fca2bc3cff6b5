// SPDX-License-Identifier: Apache-2.0
#include "cuda/net/coarse.cuh"
#include "cuda/runtime/transfer.cuh"
#include "cuda/search/exact_group_search.cuh"
#include "cuda/search/group_search.cuh"
#include "cuda/search/single_search.cuh"

namespace pointfair::cuda {
namespace {

namespace net = point::net;

constexpr int kBlock = 256;
constexpr int kGroupWarps = 23;   // of a processor
constexpr int kFewUncertain = 5;  // up to so many queries of a leaf are searched one by one

// For the exact searches: how many queries and how many leaves, and which.
struct LeftOver {
  Index *count, *queries, *leaves;
};

__host__ __device__ float share_of_scale(int scale) { return 1.0f / static_cast<float>(1 << 2 * scale); }

__global__ void __launch_bounds__(kBlock) count_points(const __grid_constant__ Tree cloud, Index* counts) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  const bool exists = at < cloud.leaves * kLeafSize && cloud.holds(at);
  const float share = exists ? cloud.share[at] : 1.0f;
  for (int scale = 0; scale < net::kScales; ++scale) {
    const int found = __syncthreads_count(exists && share < share_of_scale(scale));
    if (threadIdx.x == 0 && found > 0) atomicAdd(counts + scale, static_cast<Index>(found));
  }
}

// The places may be in any order: the index sorts them.
__global__ void __launch_bounds__(kBlock)
    choose_points(const __grid_constant__ Tree cloud, float share, Point* points, Index* members, Index* count) {
  __shared__ Index first_of_block, counts[kBlock / kWarp];
  const Index at = blockIdx.x * kBlock + threadIdx.x, warp = threadIdx.x / kWarp;
  const bool joins = at < cloud.leaves * kLeafSize && cloud.holds(at) && cloud.share[at] < share;
  const unsigned joining = __ballot_sync(kAllLanes, joins);
  if (lane_number() == 0) counts[warp] = static_cast<Index>(__popc(joining));
  __syncthreads();
  Index before = 0, all = 0;
  for (Index w = 0; w < kBlock / kWarp; ++w) {
    before += w < warp ? counts[w] : 0;
    all += counts[w];
  }
  __syncthreads();
  if (threadIdx.x == 0 && all > 0) first_of_block = atomicAdd(count, all);
  __syncthreads();
  if (!joins) return;
  const Index place = first_of_block + before + static_cast<Index>(__popc(joining & lanes_below()));
  const Vec p = position_of(cloud.points[at]);
  points[place] = {p.x, p.y, p.z};
  members[place] = at;
}

__global__ void __launch_bounds__(kBlock)
    link_places(const __grid_constant__ Tree coarse, Index count, const Index* members, Index* place, Index* own) {
  const Index c = blockIdx.x * kBlock + threadIdx.x;
  if (c >= count) return;
  place[c] = members[original_of(coarse.points[c])];
  own[place[c]] = c;
}

// Both lie along one curve, so the places are in order, but for equal keys: the result depends on no leaf to start
// from.
__device__ Index leaf_near(const Index* place, Index count, Index at) {
  Index first = 0, behind = count;
  while (first < behind) {
    const Index middle = (first + behind) / 2;
    if (place[middle] < at) {
      first = middle + 1;
    } else {
      behind = middle;
    }
  }
  return min(first, count - 1) / kLeafSize;
}

// A coarse scale as kernels see it.
struct Coarse {
  Tree tree;
  Index count;
  const Index *place, *own;

  __device__ Index leaf_near(Index leaf) const { return cuda::leaf_near(place, count, leaf * kLeafSize); }
};

constexpr float kNoLimit = __builtin_inff();

// A leaf of the cloud a block of one warp. Queries whose lists are not certain are left to the exact searches, with a
// bound in the first place of their lists; of leaves with many all are.
__global__ void __launch_bounds__(kWarp, resident_blocks(kGroupWarps, kWarp))
    nearest_of_coarse(const __grid_constant__ Tree cloud, const __grid_constant__ Coarse coarse, LeafRange leaves,
                      Index* lists, LeftOver left_over) {
  __shared__ GroupMemory<net::kNeighbors, false> memory;
  const Index leaf = leaves.begin + blockIdx.x, at = leaf * kLeafSize + lane_number();
  const float4 query = cloud.points[at];
  const bool active = is_present(query);
  Index* const list = lists + std::size_t(leaf) * net::kNeighbors * kLeafSize + lane_number();
  if (!active)
    for (int slot = 0; slot < net::kNeighbors; ++slot) list[slot * kWarp] = point::kNoNeighbor;
  if (!__any_sync(kAllLanes, active)) return;
  GroupSearch<net::kNeighbors, false, true> search(coarse.tree, memory, coarse.leaf_near(leaf), query, coarse.own[at]);
  bool found = false, is_hard = false;
  if (search.suits() && search.run(net::kNeighbors, kNoLimit)) {
    found = search.certain();
    is_hard = __popc(__ballot_sync(kAllLanes, !found)) > kFewUncertain && !search.any_dropped();
    found = active && found && !is_hard;
    search.write(net::kNeighbors, kNoLimit, list - lane_number(), found);
  }
  if (found)
    for (int slot = 0; slot < net::kNeighbors; ++slot) list[slot * kWarp] = coarse.place[list[slot * kWarp]];
  if (is_hard) {
    if (lane_number() == 0) left_over.leaves[atomicAdd(left_over.count + 1, 1u)] = leaf;
    return;
  }
  const unsigned left = __ballot_sync(kAllLanes, active && !found);
  if (left == 0) return;
  Index first = 0;
  if (lane_number() == 0) first = atomicAdd(left_over.count, static_cast<Index>(__popc(left)));
  first = __shfl_sync(kAllLanes, first, 0);
  if (active && !found) {
    left_over.queries[first + static_cast<Index>(__popc(left & lanes_below()))] = at;
    *list = __float_as_uint(search.suits() ? search.bound() : kNoLimit);
  }
}

// A warp a leaf or a query.
__global__ void __launch_bounds__(kWarp)
    nearest_of_left(const __grid_constant__ Tree cloud, const __grid_constant__ Coarse coarse, Index* lists,
                    LeftOver left_over) {
  __shared__ SingleWalk walk;
  for (Index n = blockIdx.x; n < left_over.count[1]; n += gridDim.x) {
    const Index leaf = left_over.leaves[n], at = leaf * kLeafSize + lane_number();
    ExactGroupSearch<net::kNeighbors> search(coarse.tree, coarse.leaf_near(leaf), cloud.points[at], coarse.own[at]);
    search.run(net::kNeighbors, kNoLimit);
    search.write(net::kNeighbors, lists + std::size_t(leaf) * net::kNeighbors * kLeafSize,
                 [&](Index found) { return coarse.place[found]; });
  }
  for (Index n = blockIdx.x; n < left_over.count[0]; n += gridDim.x) {
    const Index at = left_over.queries[n], own = coarse.own[at];
    Index* const out = lists + std::size_t(at / kWarp) * net::kNeighbors * kWarp + at % kWarp;
    const float bound = __uint_as_float(*out);
    __syncwarp();  // all lanes have read it
    RegisterList list(coarse.tree.points);
    const Index original = own == point::kNoNeighbor ? own : original_of(coarse.tree.points[own]);
    SingleSearch<RegisterList> search(coarse.tree, walk, list, position_of(cloud.points[at]), original, net::kNeighbors,
                                      kNoLimit);
    search.bound(bound);
    search.run();
    list.for_each(net::kNeighbors, [&](int slot, Key key) { out[slot * kWarp] = coarse.place[point::key_index(key)]; });
    __syncwarp();
  }
}

}  // namespace

ScaleCounts count_scales(Context& context, const Tree& cloud) {
  DeviceArray<Index> counts(context);
  Pinned<ScaleCounts> fetched;
  counts.resize(net::kScales);
  counts.clear("choosing coarse points");
  launch(context, "choosing coarse points", count_points, blocks_for(cloud.leaves * kLeafSize, kBlock), kBlock, cloud,
         counts.data());
  counts.download(*fetched.get(), "choosing coarse points");
  context.finish();
  return *fetched.get();
}

void CoarsePoints::choose(const Tree& cloud, int scale, Index count, const Frame& frame) {
  const std::size_t places = std::size_t(cloud.leaves) * kLeafSize;
  DeviceArray<Point> points(context_);
  DeviceArray<Index> members(context_);  // as chosen: the place in the cloud, behind the last the number of them
  points.resize(count);
  members.resize(count + std::size_t(1));
  place_.resize(count);
  own_.resize(places);
  Index* const chosen = members.data() + count;
  check(cudaMemsetAsync(chosen, 0, sizeof(Index), context_.stream()), "choosing coarse points");
  launch(context_, "choosing coarse points", choose_points, blocks_for(places, kBlock), kBlock, cloud,
         share_of_scale(scale), points.data(), members.data(), chosen);
  index_.build(points.data(), count, frame);
  check(cudaMemsetAsync(own_.data(), 0xff, places * sizeof(Index), context_.stream()), "choosing coarse points");
  launch(context_, "choosing coarse points", link_places, blocks_for(count, kBlock), kBlock, index_.tree(), count,
         members.data(), place_.data(), own_.data());
}

void CoarsePoints::find_nearest(const Tree& cloud, LeafRange leaves, Index* lists) const {
  DeviceArray<Index> room(context_);
  room.resize(2 + std::size_t(leaves.count()) * (1 + kLeafSize));
  const LeftOver left_over{room.data(), room.data() + 2 + leaves.count(), room.data() + 2};
  check(cudaMemsetAsync(room.data(), 0, 2 * sizeof(Index), context_.stream()), "searching coarse points");
  const Coarse coarse{index_.tree(), static_cast<Index>(index_.points()), place_.data(), own_.data()};
  launch(context_, "searching coarse points", nearest_of_coarse, leaves.count(), kWarp, cloud, coarse, leaves, lists,
         left_over);
  const unsigned blocks = std::min(leaves.count(), Index(context_.processors()) * 24);
  launch(context_, "searching coarse points", nearest_of_left, blocks, kWarp, cloud, coarse, lists, left_over);
}

}  // namespace pointfair::cuda
