// SPDX-License-Identifier: Apache-2.0
#include "cuda/net/coarse.cuh"
#include "cuda/runtime/transfer.cuh"
#include "cuda/search/exact_group_search.cuh"

namespace pointfair::cuda {
namespace {

namespace net = point::net;

constexpr int kBlock = 256;

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

// A leaf of the cloud a block of one warp.
__global__ void __launch_bounds__(kWarp)
    nearest_of_coarse(const __grid_constant__ Tree cloud, const __grid_constant__ Tree coarse, Index count,
                      const Index* place, const Index* own, Index* lists) {
  const Index leaf = blockIdx.x, at = leaf * kLeafSize + lane_number();
  const float4 query = cloud.points[at];
  Index* const list = lists + std::size_t(leaf) * net::kNeighbors * kLeafSize;
  if (!is_present(query))
    for (int slot = 0; slot < net::kNeighbors; ++slot) list[slot * kWarp + lane_number()] = point::kNoNeighbor;
  if (!__any_sync(kAllLanes, is_present(query))) return;
  ExactGroupSearch<net::kNeighbors> search(coarse, leaf_near(place, count, leaf * kLeafSize), query, own[at]);
  search.run(net::kNeighbors, __builtin_inff());
  search.write(net::kNeighbors, list, [place](Index found) { return place[found]; });
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
  const cudaStream_t stream = context_.stream();
  const std::size_t places = std::size_t(cloud.leaves) * kLeafSize;
  points_.resize(count);
  members_.resize(count + std::size_t(1));
  place_.resize(count);
  own_.resize(places);
  Index* const chosen = members_.data() + count;
  check(cudaMemsetAsync(chosen, 0, sizeof(Index), stream), "choosing coarse points");
  launch(context_, "choosing coarse points", choose_points, blocks_for(places, kBlock), kBlock, cloud,
         share_of_scale(scale), points_.data(), members_.data(), chosen);
  index_.build(points_.data(), count, frame);
  check(cudaMemsetAsync(own_.data(), 0xff, places * sizeof(Index), stream), "choosing coarse points");
  launch(context_, "choosing coarse points", link_places, blocks_for(count, kBlock), kBlock, index_.tree(), count,
         members_.data(), place_.data(), own_.data());
}

void CoarsePoints::find_nearest(const Tree& cloud, Index* lists) const {
  const Tree coarse = index_.tree();
  launch(context_, "searching coarse points", nearest_of_coarse, cloud.leaves, kWarp, cloud, coarse,
         static_cast<Index>(index_.points()), place_.data(), own_.data(), lists);
}

}  // namespace pointfair::cuda
