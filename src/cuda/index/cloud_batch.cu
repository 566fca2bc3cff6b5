// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>

#include "cuda/index/cloud_batch.cuh"
#include "cuda/index/curve_cells.cuh"
#include "cuda/index/hilbert.cuh"
#include "cuda/index/sort_keys.cuh"
#include "point/outliers.h"
#include "point/position.h"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = kGroupPoints;  // threads; 32 leaves, whose boxes are side by side
constexpr int kBits = 7;              // of a key an axis: on a surface about as many cells as a cloud has points
constexpr unsigned kInvalidKey = (1u << (3 * kBits)) - 1;
constexpr float kSteps = 1 << kBits;
constexpr float kInfinity = __builtin_inff();
static_assert(kMostClouds == 1u << (32 - 3 * kBits));

// The block's group of its cloud, and the thread's place in it.
struct Place {
  Index cloud;
  CloudSpan span;
  std::size_t offset;  // of the thread's point in its cloud
  __device__ Place(const CloudSpan* spans, Index groups) {
    cloud = blockIdx.x / groups;
    span = spans[cloud];
    offset = std::size_t(blockIdx.x % groups) * kBlock + threadIdx.x;
  }
  __device__ bool exists() const { return offset < span.end - span.first; }
  __device__ std::size_t uploaded() const { return span.first + offset; }
  __device__ std::size_t compact() const { return span.place + offset; }  // among the points of the batch
};

// A block to a cloud: the cube over its valid points.
__global__ void __launch_bounds__(kBlock) lay_grids(const Point* points, const CloudSpan* spans, KeyGrid* grids) {
  __shared__ Box boxes[kWarp];
  const CloudSpan span = spans[blockIdx.x];
  Box box = nothing();
  for (Index i = span.first + threadIdx.x; i < span.end; i += kBlock) {
    const Point p = points[i];
    if (!point::is_indexable(p)) continue;
    box.min = {fminf(box.min.x, p.x), fminf(box.min.y, p.y), fminf(box.min.z, p.z)};
    box.max = {fmaxf(box.max.x, p.x), fmaxf(box.max.y, p.y), fmaxf(box.max.z, p.z)};
  }
  box = united_box(box);
  if (lane_number() == 0) boxes[threadIdx.x / kWarp] = box;
  __syncthreads();
  if (threadIdx.x >= kWarp) return;
  box = boxes[threadIdx.x];
  box = united_box(box);
  if (threadIdx.x != 0) return;
  const float side = fmaxf(fmaxf(box.max.x - box.min.x, box.max.y - box.min.y), box.max.z - box.min.z);
  const float scale = kSteps / side;
  grids[blockIdx.x] = {{box.min.x, box.min.y, box.min.z}, side > 0 && scale < kInfinity ? scale : 0};
}

__device__ unsigned step_of(float coordinate, float origin, float scale) {
  return static_cast<unsigned>(fminf(fmaxf((coordinate - origin) * scale, 0.0f), kSteps - 1));
}

// By all threads of a block.
__device__ void bring(HilbertTable& table) {
  constexpr int kParts = sizeof(HilbertTable) / sizeof(uint4);
  for (int i = threadIdx.x; i < kParts; i += kBlock)
    reinterpret_cast<uint4*>(&table)[i] = reinterpret_cast<const uint4*>(&kHilbertTable)[i];
  __syncthreads();
}

// By cloud, then along the cloud's curve; invalid points behind all others of their cloud.
__global__ void __launch_bounds__(kBlock) make_keys(const Point* points, const CloudSpan* spans, Index groups,
                                                    const KeyGrid* grids, unsigned* keys, Index* order) {
  __shared__ HilbertTable table;
  bring(table);
  const Place place(spans, groups);
  if (!place.exists()) return;
  const Point p = points[place.uploaded()];
  const KeyGrid grid = grids[place.cloud];
  unsigned key = kInvalidKey;
  if (point::is_indexable(p)) {
    key = hilbert_key<unsigned, kBits>(table.entry, step_of(p.x, grid.origin[0], grid.steps_per_unit),
                                       step_of(p.y, grid.origin[1], grid.steps_per_unit),
                                       step_of(p.z, grid.origin[2], grid.steps_per_unit));
    key = min(key, kInvalidKey - 1);
  }
  keys[place.compact()] = place.cloud << (3 * kBits) | key;
  order[place.compact()] = static_cast<Index>(place.uploaded());
}

using CurveKey = std::uint64_t;
constexpr int kCloudBit = kKeyBits<kCurveBits>;  // above the bits of a key

// The key of each point along the curve of its cloud, its place, and its cloud.
__global__ void __launch_bounds__(kBlock)
    make_curve_keys(const Point* points, const CloudSpan* spans, Index groups, const CloudSettings* settings,
                    CurveKey* keys, Index* places, Index* clouds) {
  __shared__ HilbertTable table;
  bring(table);
  const Place place(spans, groups);
  if (!place.exists()) return;
  const Point p = points[place.uploaded()];
  CurveKey key = kInvalid<CurveKey, kCurveBits>;
  if (point::is_indexable(p)) key = curve_key<CurveKey>(table.entry, {p.x, p.y, p.z}, settings[place.cloud].cube);
  keys[place.compact()] = key;
  places[place.compact()] = static_cast<Index>(place.compact());
  clouds[place.compact()] = place.cloud;
}

__global__ void __launch_bounds__(kBlock)
    look_up_clouds(std::size_t count, const Index* places, const Index* clouds, Index* found, Index* order) {
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n >= count) return;
  found[n] = clouds[places[n]];
  order[n] = static_cast<Index>(n);
}

// Keys and points by cloud. A cloud's keys get a bit that those of the clouds beside it have not, so that no cell of a
// curve goes over into the next cloud.
__global__ void __launch_bounds__(kBlock)
    join_clouds(std::size_t count, const CloudSpan* spans, const Index* clouds, const Index* from, const CurveKey* keys,
                const Index* places, CurveKey* keys_out, Index* order) {
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n >= count) return;
  const Index cloud = clouds[n];
  const CurveKey key = keys[from[n]];
  const bool valid = key != kInvalid<CurveKey, kCurveBits>;
  keys_out[n] = valid ? key | CurveKey(1 + cloud % 2) << kCloudBit : key;
  order[n] = spans[cloud].first + (places[from[n]] - spans[cloud].place);
}

__global__ void clear(CloudState* state) { *state = CloudState{}; }

// Brings the points of a group into sorted order, and makes the boxes of its leaves and its own.
__global__ void __launch_bounds__(kBlock)
    gather(const Point* points, const CloudSpan* spans, Index groups, const Index* order,
           const __grid_constant__ Tree tree, const BatchIndex to) {
  __shared__ Box boxes[kWarp];
  __shared__ unsigned valid_of[kWarp];
  const Place place(spans, groups);
  const Index original = place.exists() ? order[place.compact()] : point::kNoNeighbor;
  Point p = place.exists() ? points[original] : Point{kInfinity, kInfinity, kInfinity};
  const bool valid = point::is_indexable(p);
  if (!valid) p = {kInfinity, kInfinity, kInfinity};
  to.sorted[std::size_t(blockIdx.x) * kBlock + threadIdx.x] = {p.x, p.y, p.z, __uint_as_float(original)};
  const Box box = warp_box({p.x, p.y, p.z}, valid);
  const unsigned warp = threadIdx.x / kWarp, found = __popc(__ballot_sync(kAllLanes, valid));
  if (lane_number() == 0) {
    store_box(tree.group(0, blockIdx.x), warp, box);
    boxes[warp] = box;
    valid_of[warp] = found;
  }
  __syncthreads();
  if (warp > 0) return;
  const unsigned all = warp_sum(valid_of[lane_number()]);
  if (lane_number() == 0 && all > 0) {
    atomicAdd(&to.state->valid, all);
    atomicAdd(&to.valid_of_clouds[place.cloud], all);
  }
  if (tree.levels < 2) return;
  const Box above = united_box(boxes[lane_number()]);
  const Index group = blockIdx.x % groups;
  if (lane_number() == 0) store_box(tree.group(1, place.cloud), group, above);
  if (group == 0 && lane_number() >= groups) store_box(tree.group(1, place.cloud), lane_number(), nothing());
}

__global__ void __launch_bounds__(kBlock) find_shares(const __grid_constant__ Tree tree, float* share) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole groups
  const Vec corner = tree.settings_over(static_cast<Index>(at / kLeafSize))->corner;
  share[at] = point::share_of_hash(point::position_hash(position_of(tree.points[at]), corner));
}

__global__ void __launch_bounds__(kBlock)
    limit_points(const CloudSpan* spans, Index groups, const CloudSettings* settings, const Moved moved) {
  const Place place(spans, groups);
  if (!place.exists()) return;
  const std::size_t i = place.uploaded();
  const Point before = moved.before[i], after = moved.faired[i];
  Point result = after;
  if (moved.holds_back) {
    result = before;
    if (point::is_indexable(before)) {
      const CloudSettings& its = settings[place.cloud];
      const Vec from = {before.x, before.y, before.z};
      const float level = point::node_value(its.noise_levels, from);
      const Vec to = point::limited(from, {after.x, after.y, after.z}, its.limits, level).place;
      result = {to.x, to.y, to.z};
    }
  }
  moved.out[i] = result;
}

// Two places for keys and values, and sorting there.
template <class Key>
struct Pairs {
  Pairs(Context& context, std::size_t count)
      : keys{DeviceArray<Key>(context), DeviceArray<Key>(context)},
        values{DeviceArray<Index>(context), DeviceArray<Index>(context)} {
    for (int i = 0; i < 2; ++i) {
      keys[i].resize(count);
      values[i].resize(count);
    }
  }
  void sort(Context& context, int bits) {
    cub::DoubleBuffer<Key> key_buffer(keys[0].data(), keys[1].data());
    cub::DoubleBuffer<Index> value_buffer(values[0].data(), values[1].data());
    with_scratch(context, "indexing clouds", [&](void* scratch, std::size_t& bytes) {
      return cub::DeviceRadixSort::SortPairs(scratch, bytes, key_buffer, value_buffer,
                                             static_cast<Index>(keys[0].size()), 0, bits, context.stream());
    });
    if (key_buffer.selector == 0) return;
    keys[0].swap(keys[1]);
    values[0].swap(values[1]);
  }

  DeviceArray<Key> keys[2];
  DeviceArray<Index> values[2];  // [0] is sorted, [1] spare
};

int cloud_bits(const CloudBatch& batch) { return std::max(1, int(std::bit_width(batch.clouds - 1))); }

// Indices in upload order, cloud after cloud.
void order_fast(Context& context, const Point* points, const CloudBatch& batch, DeviceArray<Index>& order) {
  const cudaStream_t stream = context.stream();
  const Index groups = static_cast<Index>(batch.groups_of_cloud());
  DeviceArray<KeyGrid> grids(context);
  grids.resize(batch.clouds);
  Pairs<unsigned> pairs(context, batch.points);
  lay_grids<<<batch.clouds, kBlock, 0, stream>>>(points, batch.spans, grids.data());
  launch(context, "indexing clouds", make_keys, batch.clouds * groups, kBlock, points, batch.spans, groups,
         grids.data(), pairs.keys[0].data(), pairs.values[0].data());
  pairs.sort(context, 3 * kBits + (batch.clouds > 1 ? cloud_bits(batch) : 0));
  order.swap(pairs.values[0]);
}

void order_along_curves(Context& context, const Point* points, const CloudBatch& batch, CloudState* state,
                        DeviceArray<Index>& order) {
  const std::size_t count = batch.points;
  const Index groups = static_cast<Index>(batch.groups_of_cloud());
  const unsigned blocks = blocks_for(count, kBlock);
  Pairs<CurveKey> by_curve(context, count);
  Pairs<Index> by_cloud(context, count);
  order.resize(count);
  launch(context, "indexing clouds", make_curve_keys, batch.clouds * groups, kBlock, points, batch.spans, groups,
         batch.settings, by_curve.keys[0].data(), by_curve.values[0].data(), order.data());
  by_curve.sort(context, kCloudBit);
  launch(context, "indexing clouds", look_up_clouds, blocks, kBlock, count, by_curve.values[0].data(), order.data(),
         by_cloud.keys[0].data(), by_cloud.values[0].data());
  by_cloud.sort(context, cloud_bits(batch));
  launch(context, "indexing clouds", join_clouds, blocks, kBlock, count, batch.spans, by_cloud.keys[0].data(),
         by_cloud.values[0].data(), by_curve.keys[0].data(), by_curve.values[0].data(), by_curve.keys[1].data(),
         order.data());
  order_cells(context, points, by_curve.keys[1].data(), count, order.data(), state, by_curve.values[1].data());
}

}  // namespace

void build_batch_index(Context& context, const Point* points, const CloudBatch& batch, const Tree& tree,
                       const BatchIndex& to) {
  const cudaStream_t stream = context.stream();
  launch(context, "indexing clouds", clear, 1, 1, to.state);
  if (batch.clouds == 0) return;
  check(cudaMemsetAsync(to.valid_of_clouds, 0, batch.clouds * sizeof(Index), stream), "indexing clouds");
  const Index groups = static_cast<Index>(batch.groups_of_cloud());
  DeviceArray<Index> order(context);
  if (batch.settings == nullptr) {
    order_fast(context, points, batch, order);
  } else {
    order_along_curves(context, points, batch, to.state, order);
  }
  launch(context, "indexing clouds", gather, batch.clouds * groups, kBlock, points, batch.spans, groups, order.data(),
         tree, to);
}

void hash_positions(Context& context, const Tree& tree, float* share) {
  if (tree.leaves == 0) return;
  launch(context, "hashing positions", find_shares, tree.leaves / kLeafSize, kBlock, tree, share);
}

void limit(Context& context, const CloudBatch& batch, const Moved& moved) {
  if (batch.clouds == 0) return;
  const Index groups = static_cast<Index>(batch.groups_of_cloud());
  launch(context, "holding back outliers", limit_points, batch.clouds * groups, kBlock, batch.spans, groups,
         batch.settings, moved);
}

}  // namespace pointfair::cuda
