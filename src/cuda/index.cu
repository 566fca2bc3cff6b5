// SPDX-License-Identifier: Apache-2.0
#include <cub/device/device_radix_sort.cuh>

#include "cuda/hilbert.cuh"
#include "cuda/index.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kSample = 1024;
constexpr int kKeyBlock = 256;
constexpr int kBoxBlock = 1024;  // threads; 32 leaves, so a block also has the box of the level above
constexpr float kInfinity = __builtin_inff();

__device__ bool is_valid(Point p) { return point::is_indexable(p.x, p.y, p.z); }

// Sorts three arrays of kSample floats at once, a thread an element.
__device__ void sort_sample(float (*values)[kSample]) {
  const int i = int(threadIdx.x);
  for (int size = 2; size <= kSample; size *= 2) {
    for (int stride = size / 2; stride > 0; stride /= 2) {
      __syncthreads();
      const int j = i ^ stride;
      if (j <= i) continue;
      for (int axis = 0; axis < 3; ++axis) {
        const float a = values[axis][i], b = values[axis][j];
        if ((a > b) == ((i & size) == 0)) {
          values[axis][i] = b;
          values[axis][j] = a;
        }
      }
    }
  }
  __syncthreads();
}

// Lays the key's cube over most points: between the 2 % and the 98 % quantile of a sample on each axis, widened by the
// longest side, and no wider than the sample itself. A stray point far away does not stretch it; points outside are
// clamped for the key only.
__global__ void prepare(const Point* points, std::size_t count, float steps, CloudState* state) {
  __shared__ float values[3][kSample];
  const std::size_t size = min(count, std::size_t(kSample));
  const bool taken = threadIdx.x < size;
  const Point p = taken ? points[threadIdx.x * count / size] : Point{};
  const bool valid = taken && is_valid(p);
  values[0][threadIdx.x] = valid ? p.x : kInfinity;
  values[1][threadIdx.x] = valid ? p.y : kInfinity;
  values[2][threadIdx.x] = valid ? p.z : kInfinity;
  const int found = __syncthreads_count(valid);
  sort_sample(values);
  if (threadIdx.x != 0) return;
  float low[3] = {}, high[3] = {}, longest = 0, side = 0;
  const int cut = found / 50;
  for (int axis = 0; axis < 3 && found > 0; ++axis)
    longest = fmaxf(longest, values[axis][found - 1 - cut] - values[axis][cut]);
  for (int axis = 0; axis < 3 && found > 0; ++axis) {
    const float first = values[axis][0], last = values[axis][found - 1];
    const float slack = (longest > 0 ? longest : last - first) / 32;
    low[axis] = fmaxf(first - slack, longest > 0 ? values[axis][cut] - longest : first);
    high[axis] = fminf(last + slack, longest > 0 ? values[axis][found - 1 - cut] + longest : last);
    side = fmaxf(side, high[axis] - low[axis]);
  }
  const float scale = steps / side;
  *state = CloudState{};
  for (int axis = 0; axis < 3; ++axis) {
    state->origin[axis] = low[axis];
    state->min[axis] = ~0u;
  }
  state->steps_per_unit = side > 0 && scale < kInfinity ? scale : 0;
}

__device__ unsigned grid_step(float coordinate, float origin, float steps_per_unit, float last) {
  return static_cast<unsigned>(fminf(fmaxf((coordinate - origin) * steps_per_unit, 0.0f), last));
}

struct BoundsSum {
  unsigned min[3] = {~0u, ~0u, ~0u}, max[3] = {};
  unsigned valid = 0;
  __device__ void add(Point p) {
    const float v[3] = {p.x, p.y, p.z};
    for (int axis = 0; axis < 3; ++axis) {
      min[axis] = ::min(min[axis], ordered(v[axis]));
      max[axis] = ::max(max[axis], ordered(v[axis]));
    }
    ++valid;
  }
  __device__ void publish(CloudState* state) {
    for (int axis = 0; axis < 3; ++axis) {
      const unsigned low = warp_min(min[axis]), high = warp_max(max[axis]);
      if (lane_number() == 0 && low < state->min[axis]) atomicMin(&state->min[axis], low);
      if (lane_number() == 0 && high > state->max[axis]) atomicMax(&state->max[axis], high);
    }
    for (int step = kWarp / 2; step > 0; step /= 2) valid += __shfl_xor_sync(kAllLanes, valid, step);
    if (lane_number() == 0 && valid > 0) atomicAdd(&state->valid, valid);
  }
};

// Invalid points get the last key, which no valid point has, so they end up behind all others.
template <class Key, int kBits>
__global__ void make_keys(const Point* points, std::size_t count, CloudState* state, Key* keys, Index* order) {
  constexpr Key kLast = (Key(1) << (3 * kBits)) - 1;
  const float origin[3] = {state->origin[0], state->origin[1], state->origin[2]}, scale = state->steps_per_unit;
  BoundsSum bounds;
  for (std::size_t i = std::size_t(blockIdx.x) * kKeyBlock + threadIdx.x; i < count;
       i += std::size_t(gridDim.x) * kKeyBlock) {
    const Point p = points[i];
    Key key = kLast;
    if (is_valid(p)) {
      constexpr float kLastStep = (1 << kBits) - 1;
      key = hilbert_key<Key, kBits>(grid_step(p.x, origin[0], scale, kLastStep),
                                    grid_step(p.y, origin[1], scale, kLastStep),
                                    grid_step(p.z, origin[2], scale, kLastStep));
      key = key < kLast ? key : kLast - 1;
      bounds.add(p);
    }
    keys[i] = key;
    order[i] = static_cast<Index>(i);
  }
  bounds.publish(state);
}

__device__ void store_box(const Level& level, Index node, const Box& box, Index least_original) {
  float* b = level.boxes + node;
  const std::size_t stride = level.stride;
  b[0] = box.min.x, b[stride] = box.min.y, b[2 * stride] = box.min.z;
  b[3 * stride] = box.max.x, b[4 * stride] = box.max.y, b[5 * stride] = box.max.z;
  level.least_original[node] = least_original;
}

__device__ Box united_box(const Box& mine) { return {warp_box(mine.min, true).min, warp_box(mine.max, true).max}; }

// Brings the points into sorted order and makes the boxes of their leaves and of the level above.
__global__ void __launch_bounds__(kBoxBlock)
    gather(const Point* points, std::size_t count, const Index* order, const CloudState* state, float4* sorted,
           Index leaves, Level leaf_level, Level level_above) {
  __shared__ Box boxes[kWarp];
  __shared__ Index least[kWarp];
  const std::size_t i = std::size_t(blockIdx.x) * kBoxBlock + threadIdx.x;
  const Index leaf = static_cast<Index>(i / kLeafSize);
  const bool valid = i < state->valid;
  const Index original = i < count ? order[i] : point::kNoNeighbor;
  const Point p = valid ? points[original] : Point{kInfinity, kInfinity, kInfinity};
  if (leaf < leaves) sorted[i] = {p.x, p.y, p.z, __uint_as_float(original)};
  const Box box = warp_box({p.x, p.y, p.z}, valid);
  const Index first = warp_min(valid ? original : point::kNoNeighbor);
  if (lane_number() == 0) {
    store_box(leaf_level, leaf, box, first);
    boxes[threadIdx.x / kWarp] = box;
    least[threadIdx.x / kWarp] = first;
  }
  __syncthreads();
  if (threadIdx.x >= kWarp || level_above.boxes == nullptr) return;
  const Box above = united_box(boxes[threadIdx.x]);
  const Index first_above = warp_min(least[threadIdx.x]);
  if (threadIdx.x == 0) store_box(level_above, blockIdx.x, above, first_above);
}

// The levels from `first` on, by one block: the padding of each, then the boxes of the next.
__global__ void __launch_bounds__(kBoxBlock) gather_upper_levels(Tree tree, int first, Index nodes) {
  const Box nothing = {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
  for (int l = first; l < tree.levels; ++l) {
    const Level level = tree.level[l];
    for (Index node = nodes + threadIdx.x; node < level.stride; node += kBoxBlock)
      store_box(level, node, nothing, point::kNoNeighbor);
    __syncthreads();
    nodes = (nodes + kLeafSize - 1) / kLeafSize;
    for (Index node = threadIdx.x / kWarp; node < nodes && l + 1 < tree.levels; node += kBoxBlock / kWarp) {
      const Index child = node * kLeafSize + lane_number();
      const Box box = united_box(box_of_child(level, child));
      const Index least = warp_min(level.least_original[child]);
      if (lane_number() == 0) store_box(tree.level[l + 1], node, box, least);
    }
    __syncthreads();
  }
}

std::size_t padded(std::size_t nodes) { return (nodes + kLeafSize - 1) / kLeafSize * kLeafSize; }

}  // namespace

DeviceIndex::DeviceIndex(Context& context)
    : context_(context), state_(context), points_(context), boxes_(context), least_original_(context) {}

Tree DeviceIndex::tree() const {
  Tree tree{points_.data(), state_.data(), static_cast<Index>(leaves_), levels_, {}};
  std::copy_n(level_, kMaxLevels, tree.level);
  return tree;
}

void DeviceIndex::build(const Point* points, std::size_t count) {
  count_ = count;
  leaves_ = (count + kLeafSize - 1) / kLeafSize;
  state_.resize(1);
  points_.resize(leaves_ * kLeafSize);
  DeviceArray<Index> order(context_);
  constexpr std::size_t kManyPoints = 1 << 24;  // from here on cells of 2^10 steps an axis hold too many points each
  if (count < kManyPoints) {
    sort<std::uint32_t>(points, 10, order);
  } else {
    sort<std::uint64_t>(points, 13, order);
  }
  build_boxes(points, order.data());
}

template <class Key>
void DeviceIndex::sort(const Point* points, int bits, DeviceArray<Index>& order) {
  constexpr int kBits = sizeof(Key) == 4 ? 10 : 13;
  DeviceArray<Key> keys(context_), sorted_keys(context_);
  DeviceArray<Index> unsorted(context_);
  keys.resize(count_);
  sorted_keys.resize(count_);
  unsorted.resize(count_);
  order.resize(count_);
  const cudaStream_t stream = context_.stream();
  prepare<<<1, kSample, 0, stream>>>(points, count_, float(1 << bits), state_.data());
  check(cudaGetLastError(), "laying out the index");
  const unsigned blocks = std::min(blocks_for(count_, kKeyBlock), unsigned(context_.processors()) * 8);
  make_keys<Key, kBits><<<blocks, kKeyBlock, 0, stream>>>(points, count_, state_.data(), keys.data(), unsorted.data());
  check(cudaGetLastError(), "making sort keys");
  if (count_ == 0) return;
  cub::DoubleBuffer<Key> both_keys(keys.data(), sorted_keys.data());
  cub::DoubleBuffer<Index> both_orders(unsorted.data(), order.data());
  std::size_t bytes = 0;
  check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, both_keys, both_orders, count_, 0, 3 * kBits, stream),
        "sizing the sort");
  DeviceArray<std::byte> scratch(context_);
  scratch.resize(bytes);
  check(cub::DeviceRadixSort::SortPairs(scratch.data(), bytes, both_keys, both_orders, count_, 0, 3 * kBits, stream),
        "sorting");
  if (both_orders.Current() != order.data()) order.swap(unsorted);
}

void DeviceIndex::build_boxes(const Point* points, const Index* order) {
  std::size_t nodes[kMaxLevels] = {std::max<std::size_t>(1, leaves_)}, all = padded(nodes[0]);
  for (levels_ = 1; nodes[levels_ - 1] > kLeafSize; ++levels_) {
    nodes[levels_] = (nodes[levels_ - 1] + kLeafSize - 1) / kLeafSize;
    all += padded(nodes[levels_]);
  }
  boxes_.resize(6 * all);
  least_original_.resize(all);
  std::size_t start = 0;
  for (int l = 0; l < kMaxLevels; ++l) {
    level_[l] = {};
    if (l >= levels_) continue;
    level_[l] = {boxes_.data() + 6 * start, least_original_.data() + start, static_cast<Index>(padded(nodes[l]))};
    start += padded(nodes[l]);
  }
  const cudaStream_t stream = context_.stream();
  gather<<<blocks_for(leaves_, kWarp), kBoxBlock, 0, stream>>>(points, count_, order, state_.data(), points_.data(),
                                                               static_cast<Index>(leaves_), level_[0], level_[1]);
  check(cudaGetLastError(), "gathering points");
  if (levels_ < 2) return;
  gather_upper_levels<<<1, kBoxBlock, 0, stream>>>(tree(), 1, static_cast<Index>(nodes[1]));
  check(cudaGetLastError(), "building the tree");
}

}  // namespace pointfair::cuda
