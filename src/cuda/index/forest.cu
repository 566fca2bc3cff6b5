// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <cub/device/device_radix_sort.cuh>

#include "cuda/index/forest.cuh"
#include "cuda/index/hilbert.cuh"

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
  Index cloud, first, end;  // of the cloud's points
  std::size_t i;            // in upload order; `end` and beyond: no point
  __device__ Place(const Index* ends, Index groups) {
    cloud = blockIdx.x / groups;
    first = cloud == 0 ? 0 : ends[cloud - 1];
    end = ends[cloud];
    i = first + std::size_t(blockIdx.x % groups) * kBlock + threadIdx.x;
  }
  __device__ bool exists() const { return i < end; }
};

__device__ void store_box(BoxGroup& group, unsigned child, const Box& box) {
  const float bounds[6] = {box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z};
  for (int b = 0; b < 6; ++b) group.bound[b][child] = bounds[b];
}
__device__ Box nothing() { return {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}}; }

// A block to a cloud: the cube over its valid points.
__global__ void __launch_bounds__(kBlock) lay_grids(const Point* points, const Index* ends, KeyGrid* grids) {
  __shared__ Box boxes[kWarp];
  const Index first = blockIdx.x == 0 ? 0 : ends[blockIdx.x - 1], end = ends[blockIdx.x];
  Box box = nothing();
  for (Index i = first + threadIdx.x; i < end; i += kBlock) {
    const Point p = points[i];
    if (!is_valid(p)) continue;
    box.min = {fminf(box.min.x, p.x), fminf(box.min.y, p.y), fminf(box.min.z, p.z)};
    box.max = {fmaxf(box.max.x, p.x), fmaxf(box.max.y, p.y), fmaxf(box.max.z, p.z)};
  }
  box = {warp_box(box.min, true).min, warp_box(box.max, true).max};
  if (lane_number() == 0) boxes[threadIdx.x / kWarp] = box;
  __syncthreads();
  if (threadIdx.x >= kWarp) return;
  box = boxes[threadIdx.x];
  box = {warp_box(box.min, true).min, warp_box(box.max, true).max};
  if (threadIdx.x != 0) return;
  const float side = fmaxf(fmaxf(box.max.x - box.min.x, box.max.y - box.min.y), box.max.z - box.min.z);
  const float scale = kSteps / side;
  grids[blockIdx.x] = {{box.min.x, box.min.y, box.min.z}, side > 0 && scale < kInfinity ? scale : 0};
}

__device__ unsigned step_of(float coordinate, float origin, float scale) {
  return static_cast<unsigned>(fminf(fmaxf((coordinate - origin) * scale, 0.0f), kSteps - 1));
}

// By cloud, then along the cloud's curve; invalid points behind all others of their cloud.
__global__ void __launch_bounds__(kBlock) make_keys(const Point* points, const Index* ends, Index groups,
                                                    const KeyGrid* grids, unsigned* keys, Index* order) {
  __shared__ HilbertTable table;
  constexpr int kParts = sizeof(HilbertTable) / sizeof(uint4);
  for (int i = threadIdx.x; i < kParts; i += kBlock)
    reinterpret_cast<uint4*>(&table)[i] = reinterpret_cast<const uint4*>(&kHilbertTable)[i];
  __syncthreads();
  const Place place(ends, groups);
  if (!place.exists()) return;
  const Point p = points[place.i];
  const KeyGrid grid = grids[place.cloud];
  unsigned key = kInvalidKey;
  if (is_valid(p)) {
    key = hilbert_key<unsigned, kBits>(table.entry, step_of(p.x, grid.origin[0], grid.steps_per_unit),
                                       step_of(p.y, grid.origin[1], grid.steps_per_unit),
                                       step_of(p.z, grid.origin[2], grid.steps_per_unit));
    key = min(key, kInvalidKey - 1);
  }
  keys[place.i] = place.cloud << (3 * kBits) | key;
  order[place.i] = static_cast<Index>(place.i);
}

__global__ void clear(CloudState* state) { *state = CloudState{}; }

// Brings the points of a group into sorted order, and makes the boxes of its leaves and its own.
__global__ void __launch_bounds__(kBlock)
    gather(const Point* points, const Index* ends, Index groups, const Index* order, const __grid_constant__ Tree tree,
           float4* sorted, CloudState* state) {
  __shared__ Box boxes[kWarp];
  __shared__ unsigned valid_of[kWarp];
  const Place place(ends, groups);
  const Index original = place.exists() ? order[place.i] : point::kNoNeighbor;
  Point p = place.exists() ? points[original] : Point{kInfinity, kInfinity, kInfinity};
  const bool valid = is_valid(p);
  if (!valid) p = {kInfinity, kInfinity, kInfinity};
  sorted[std::size_t(blockIdx.x) * kBlock + threadIdx.x] = {p.x, p.y, p.z, __uint_as_float(original)};
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
  if (lane_number() == 0 && all > 0) atomicAdd(&state->valid, all);
  if (tree.levels < 2) return;
  const Box mine = boxes[lane_number()];
  const Box above = {warp_box(mine.min, true).min, warp_box(mine.max, true).max};
  const Index group = blockIdx.x % groups;
  if (lane_number() == 0) store_box(tree.group(1, place.cloud), group, above);
  if (group == 0 && lane_number() >= groups) store_box(tree.group(1, place.cloud), lane_number(), nothing());
}

}  // namespace

void plant(Context& context, const Point* points, const Forest& forest, const Tree& tree, float4* sorted,
           CloudState* state) {
  const cudaStream_t stream = context.stream();
  clear<<<1, 1, 0, stream>>>(state);
  check(cudaGetLastError(), "planting");
  if (forest.clouds == 0) return;
  const Index groups = static_cast<Index>(forest.groups_of_cloud());
  const unsigned blocks = static_cast<unsigned>(forest.clouds * groups);
  DeviceArray<KeyGrid> grids(context);
  DeviceArray<unsigned> keys[2] = {DeviceArray<unsigned>(context), DeviceArray<unsigned>(context)};
  DeviceArray<Index> order[2] = {DeviceArray<Index>(context), DeviceArray<Index>(context)};
  DeviceArray<std::byte> scratch(context);
  grids.resize(forest.clouds);
  for (int i = 0; i < 2; ++i) {
    keys[i].resize(forest.points);
    order[i].resize(forest.points);
  }
  lay_grids<<<forest.clouds, kBlock, 0, stream>>>(points, forest.ends, grids.data());
  make_keys<<<blocks, kBlock, 0, stream>>>(points, forest.ends, groups, grids.data(), keys[0].data(), order[0].data());
  check(cudaGetLastError(), "planting");
  cub::DoubleBuffer<unsigned> sorted_keys(keys[0].data(), keys[1].data());
  cub::DoubleBuffer<Index> sorted_order(order[0].data(), order[1].data());
  std::size_t bytes = 0;
  for (const bool sizing : {true, false}) {
    check(cub::DeviceRadixSort::SortPairs(sizing ? nullptr : scratch.data(), bytes, sorted_keys, sorted_order,
                                          static_cast<Index>(forest.points), 0,
                                          3 * kBits + std::bit_width(forest.clouds - 1), stream),
          "planting");
    if (sizing) scratch.resize(bytes);
  }
  gather<<<blocks, kBlock, 0, stream>>>(points, forest.ends, groups, sorted_order.Current(), tree, sorted, state);
  check(cudaGetLastError(), "planting");
}

}  // namespace pointfair::cuda
