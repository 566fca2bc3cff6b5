// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>

#include "cuda/runtime/warp.cuh"
#include "cuda/tiles/gathered_tiles.cuh"
#include "point/position.h"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / kWarp;
constexpr int kItems = 8;  // points of a thread
constexpr int kMost = int(DeviceTiles::kMostTiles);

using Vec = point::Vec3<float>;

struct Regions {
  point::Region of[kMost];
  int count;
};

struct Starts {
  std::size_t of[kMost];
};

__device__ Vec to_vec(Point p) { return {p.x, p.y, p.z}; }
// Invalid points keep their places, and need nothing.
__global__ void __launch_bounds__(kBlock)
    begin_all(const Point* input, std::size_t count, Point* results, unsigned char* done) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i >= count) return;
  const Point p = input[i];
  const bool valid = point::is_indexable(p);
  done[i] = !valid;
  if (!valid) results[i] = p;
}

__global__ void __launch_bounds__(kBlock)
    count_inside(const Point* input, std::size_t count, const __grid_constant__ Regions regions, unsigned* totals) {
  __shared__ unsigned inside[kMost];
  if (threadIdx.x < kMost) inside[threadIdx.x] = 0;
  __syncthreads();
  const std::size_t first = std::size_t(blockIdx.x) * kBlock * kItems + threadIdx.x;
  for (int item = 0; item < kItems; ++item) {
    const std::size_t i = first + std::size_t(item) * kBlock;
    const Point p = i < count ? input[i] : Point{};
    const bool valid = i < count && point::is_indexable(p);
    for (int tile = 0; tile < regions.count; ++tile) {
      const unsigned ballot = __ballot_sync(kAllLanes, valid && point::is_inside(regions.of[tile], to_vec(p)));
      if (lane_number() == 0 && ballot != 0) atomicAdd(&inside[tile], static_cast<unsigned>(__popc(ballot)));
    }
  }
  __syncthreads();
  if (threadIdx.x < regions.count && inside[threadIdx.x] > 0) atomicAdd(&totals[threadIdx.x], inside[threadIdx.x]);
}

// Numbers before each of a block's, which take their places, and the sum. For one warp.
template <int kCount>
__device__ unsigned sum_before(unsigned* numbers) {
  static_assert(kCount == 2 * kWarp);
  const unsigned lane = lane_number(), first = numbers[2 * lane], both = first + numbers[2 * lane + 1];
  unsigned until = both;
  for (unsigned step = 1; step < kWarp; step *= 2) {
    const unsigned before = __shfl_up_sync(kAllLanes, until, step);
    if (lane >= step) until += before;
  }
  numbers[2 * lane] = until - both;
  numbers[2 * lane + 1] = until - both + first;
  return __shfl_sync(kAllLanes, until, kWarp - 1);
}

// Appends the points in each region to its own, `starts[tile]` points on. Those of a block stay together, in their
// order. All tiles in one go: each look at the whole cloud takes as long as the copies.
__global__ void __launch_bounds__(kBlock)
    append_inside(const Point* input, std::size_t count, const __grid_constant__ Regions regions,
                  const __grid_constant__ Starts starts, unsigned* totals, unsigned* indices, Point* points) {
  __shared__ unsigned places[kItems * kWarps];
  __shared__ unsigned block_start;
  const std::size_t first = std::size_t(blockIdx.x) * kBlock * kItems + threadIdx.x;
  const unsigned warp = threadIdx.x / kWarp;
  Point own[kItems];
  unsigned valid = 0;
  for (int item = 0; item < kItems; ++item) {
    const std::size_t i = first + std::size_t(item) * kBlock;
    own[item] = i < count ? input[i] : Point{};
    valid |= unsigned(i < count && point::is_indexable(own[item])) << item;
  }
  for (int tile = 0; tile < regions.count; ++tile) {
    unsigned ballots[kItems], any = 0;
    for (int item = 0; item < kItems; ++item) {
      const bool inside = (valid >> item & 1) != 0 && point::is_inside(regions.of[tile], to_vec(own[item]));
      ballots[item] = __ballot_sync(kAllLanes, inside);
      any |= ballots[item];
    }
    if (__syncthreads_or(int(any)) == 0) continue;  // and `places` has no more readers
    for (int item = 0; item < kItems; ++item)
      if (lane_number() == 0) places[item * kWarps + warp] = static_cast<unsigned>(__popc(ballots[item]));
    __syncthreads();
    if (warp == 0) {
      const unsigned sum = sum_before<kItems * kWarps>(places);
      if (lane_number() == 0) block_start = atomicAdd(&totals[tile], sum);
    }
    __syncthreads();
    for (int item = 0; item < kItems; ++item) {
      if ((ballots[item] >> lane_number() & 1) == 0) continue;
      const std::size_t to = starts.of[tile] + block_start + places[item * kWarps + warp] +
                             static_cast<unsigned>(__popc(ballots[item] & lanes_below()));
      indices[to] = static_cast<unsigned>(first + std::size_t(item) * kBlock);
      points[to] = own[item];
    }
  }
}

__global__ void clear_tallies(TallyOnCard* tallies) { tallies[threadIdx.x] = {{~0u, ~0u, ~0u}, {}, 0, 0, 0, 0}; }

__device__ void add_if_any(unsigned& to, unsigned value) {
  if (value > 0) atomicAdd(&to, value);
}

// The results of one tile.
__global__ void __launch_bounds__(kBlock)
    take_results(const Point* input, Point* results, unsigned char* done, point::Cell cell, std::size_t count,
                 const unsigned* indices, const Point* points, const unsigned char* outcomes, TallyOnCard* tally) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  bool taken = false, left = false;
  Vec p{};
  unsigned outcome = 0;
  if (i < count) {
    const unsigned index = indices[i];
    p = to_vec(input[index]);
    outcome = outcomes[i];
    const bool wanted = done[index] == 0 && point::is_in_cell(cell, p);
    taken = wanted && (outcome & point::kExact) != 0;
    left = wanted && !taken;
    if (taken) {
      results[index] = points[i];
      done[index] = 1;
    }
  }
  const auto count_lanes = [](bool value) { return static_cast<unsigned>(__popc(__ballot_sync(kAllLanes, value))); };
  const unsigned too_few = count_lanes(taken && (outcome & point::kTooFew) != 0),
                 no_normal = count_lanes(taken && (outcome & point::kNoNormal) != 0),
                 is_short = count_lanes(taken && (outcome & point::kShort) != 0), still_left = count_lanes(left);
  if (lane_number() == 0) {
    add_if_any(tally->too_few, too_few);
    add_if_any(tally->no_normal, no_normal);
    add_if_any(tally->is_short, is_short);
    add_if_any(tally->left, still_left);
  }
  if (!left) return;
  const float at[3] = {p.x, p.y, p.z};
  for (int axis = 0; axis < 3; ++axis) {
    atomicMin(&tally->min[axis], ordered(at[axis]));
    atomicMax(&tally->max[axis], ordered(at[axis]));
  }
}

float coordinate(unsigned o) { return std::bit_cast<float>(unordered_bits(o)); }

TileTally to_host(const TallyOnCard& tally) {
  TileTally result{};
  result.counts.unmoved.too_few_neighbors = tally.too_few;
  result.counts.unmoved.no_normal = tally.no_normal;
  result.counts.short_neighborhoods = tally.is_short;
  result.left = {{coordinate(tally.min[0]), coordinate(tally.min[1]), coordinate(tally.min[2])},
                 {coordinate(tally.max[0]), coordinate(tally.max[1]), coordinate(tally.max[2])},
                 tally.left};
  return result;
}

}  // namespace

GatheredTiles::GatheredTiles(Context& context)
    : context_(context),
      done_(context),
      outcomes_(context),
      indices_(context),
      totals_(context),
      points_(context),
      tallies_(context),
      fetched_totals_(kMost),
      fetched_tallies_(kMost) {}

void GatheredTiles::begin(const Point* input, std::size_t count, Point* results) {
  input_ = input;
  count_ = count;
  results_ = results;
  done_.resize(count);
  if (count == 0) return;
  launch(context_, "preparing tiles", begin_all, blocks_for(count, kBlock), kBlock, input, count, results,
         done_.data());
}

std::vector<std::size_t> GatheredTiles::gather(std::span<const DeviceTile> tiles) {
  const cudaStream_t stream = context_.stream();
  const unsigned blocks = blocks_for(count_, kBlock * kItems);
  tiles_.assign(tiles.begin(), tiles.end());
  Regions regions{};
  for (const DeviceTile& tile : tiles) regions.of[regions.count++] = tile.loaded;
  totals_.resize(kMost);
  totals_.clear("counting points of tiles");
  launch(context_, "counting points of tiles", count_inside, blocks, kBlock, input_, count_, regions, totals_.data());
  totals_.download({fetched_totals_.get(), kMost}, "counting points of tiles");
  totals_.clear("gathering points of tiles");
  context_.finish();
  const std::vector<std::size_t> counts(fetched_totals_.get(), fetched_totals_.get() + tiles.size());
  starts_.assign(1, 0);
  for (const std::size_t its : counts) starts_.push_back(starts_.back() + its);
  indices_.resize(starts_.back());
  points_.resize(starts_.back());
  outcomes_.resize(starts_.back());
  Starts starts{};
  std::copy_n(starts_.begin(), tiles.size(), starts.of);
  launch(context_, "gathering points of tiles", append_inside, blocks, kBlock, input_, count_, regions, starts,
         totals_.data(), indices_.data(), points_.data());
  there_.record(stream);
  return counts;
}

std::vector<unsigned> GatheredTiles::indices_of(std::size_t tile) const {
  std::vector<unsigned> indices(size_of(tile));
  check(cudaMemcpyAsync(indices.data(), indices_.data() + starts_[tile], indices.size() * sizeof(unsigned),
                        cudaMemcpyDeviceToHost, context_.stream()),
        "reading the points of a tile");
  context_.finish();
  return indices;
}

GatheredTiles::Share GatheredTiles::share(std::size_t tile) const {
  return {tiles_[tile], size_of(tile), points_.data() + starts_[tile], outcomes_.data() + starts_[tile], there_.get()};
}

std::vector<TileTally> GatheredTiles::scatter() {
  const cudaStream_t stream = context_.stream();
  tallies_.resize(kMost);
  clear_tallies<<<1, kMost, 0, stream>>>(tallies_.data());
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile)
    launch(context_, "taking the results of tiles", take_results, blocks_for(size_of(tile), kBlock), kBlock, input_,
           results_, done_.data(), tiles_[tile].cell, size_of(tile), indices_.data() + starts_[tile],
           points_.data() + starts_[tile], outcomes_.data() + starts_[tile], tallies_.data() + tile);
  tallies_.download({fetched_tallies_.get(), kMost}, "taking the results of tiles");
  context_.finish();
  std::vector<TileTally> tallies;
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile) tallies.push_back(to_host(fetched_tallies_.get()[tile]));
  return tallies;
}

}  // namespace pointfair::cuda
