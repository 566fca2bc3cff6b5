// SPDX-License-Identifier: Apache-2.0
#include <thrust/iterator/discard_iterator.h>

#include <algorithm>
#include <cub/device/device_merge.cuh>
#include <cub/device/device_radix_sort.cuh>
#include <cuda/std/functional>

#include "cuda/hilbert.cuh"
#include "cuda/index.cuh"
#include "cuda/launch.cuh"
#include "point/curve.h"

namespace pointfair::cuda {

using CoarseKey = std::uint32_t;

// Indices of points in the order of their keys, and these keys if they are to be refined.
struct Sorted {
  explicit Sorted(Context& context) : order(context), coarse(context) {}
  DeviceArray<Index> order;
  DeviceArray<CoarseKey> coarse;
};

namespace {

constexpr int kSample = 256;
constexpr int kKeyBlock = 256;
constexpr int kKeysAtOnce = 4;  // loads in flight
constexpr int kKeysOfBlock = kKeyBlock * kKeysAtOnce;
constexpr int kBoxBlock = 1024;  // threads; 32 leaves, so a block also has the box of the level above
constexpr float kInfinity = __builtin_inff();

__device__ bool is_valid(Point p) { return point::is_indexable(p.x, p.y, p.z); }

// A sample of one axis over the lanes of a warp, as ordered() numbers; kNothing marks an empty place.
struct Sample {
  static constexpr unsigned kNothing = ~0u;
  static constexpr int kHeld = kSample / kWarp;
  unsigned values[kHeld];

  // The least value left, which is then taken out.
  __device__ unsigned take_least() {
    unsigned least = kNothing;
    for (int i = 0; i < kHeld; ++i) least = min(least, values[i]);
    const unsigned result = warp_min(least);
    const int lane = __ffs(static_cast<int>(__ballot_sync(kAllLanes, least == result))) - 1;
    bool taken = static_cast<int>(lane_number()) != lane;
    for (int i = 0; i < kHeld; ++i) {
      const bool here = !taken && values[i] == result;
      values[i] = here ? kNothing : values[i];
      taken = taken || here;
    }
    return result;
  }
  // The least value, and that which has `rank` below it. The sample is used up.
  __device__ void measure(int rank, float& least, float& at_rank) {
    unsigned value = take_least();
    least = unordered(value);
    for (int i = 0; i < rank; ++i) value = take_least();
    at_rank = unordered(value);
  }
};

// The points that are sampled: every so many of those on the card, or those of a cloud that is not there yet.
struct EverySo {
  const Point* points;
  std::size_t stride;
  __device__ Point operator[](unsigned i) const { return points[i * stride]; }
};
struct Brought {
  Point points[kSample];
  __device__ Point operator[](unsigned i) const { return points[i]; }
};

// Lays the key's cube over most points: between the 2 % and the 98 % quantile of a sample on each axis, widened by the
// longest side, and no wider than the sample itself. A stray point far away does not stretch it; points outside are
// clamped for the key only.
constexpr int kPrepareBlock = 6 * kWarp;  // a warp for each end of each axis
template <class Sampled>
__global__ void __launch_bounds__(kPrepareBlock)
    prepare(const __grid_constant__ Sampled sampled, unsigned size, float steps, CloudState* state) {
  __shared__ float first[3], last[3], low[3], high[3];  // by axis: ends and quantiles
  begin_kernel();
  const unsigned axis = threadIdx.x / kWarp % 3;
  const bool upper = threadIdx.x / kWarp >= 3;
  Sample sample;
  int found = 0;
#pragma unroll
  for (int i = 0; i < Sample::kHeld; ++i) {
    const unsigned place = i * kWarp + lane_number();
    const Point p = place < size ? sampled[place] : Point{__int_as_float(0x7fc00000), 0, 0};
    const bool valid = is_valid(p);
    const float value = axis == 0 ? p.x : axis == 1 ? p.y : p.z;
    sample.values[i] = valid ? ordered(upper ? -value : value) : Sample::kNothing;
    found += __popc(__ballot_sync(kAllLanes, valid));
  }
  float least, quantile;
  sample.measure(found / 50, least, quantile);
  (upper ? last : first)[axis] = upper ? -least : least;
  (upper ? high : low)[axis] = upper ? -quantile : quantile;
  __syncthreads();
  if (threadIdx.x != 0) return;
  float longest = 0, side = 0, origin[3] = {};
  for (int a = 0; a < 3 && found > 0; ++a) longest = fmaxf(longest, high[a] - low[a]);
  for (int a = 0; a < 3 && found > 0; ++a) {
    const bool spread = longest > 0;  // else nearly all are in one place, and the ends must do
    const float slack = (spread ? longest : last[a] - first[a]) / 32;
    origin[a] = fmaxf(first[a] - slack, spread ? low[a] - longest : first[a]);
    side = fmaxf(side, fminf(last[a] + slack, spread ? high[a] + longest : last[a]) - origin[a]);
  }
  const float scale = steps / side;
  *state = CloudState{};
  for (int a = 0; a < 3; ++a) {
    state->origin[a] = origin[a];
    state->min[a] = ~0u;
  }
  state->steps_per_unit = side > 0 && scale < kInfinity ? scale : 0;
}

__device__ unsigned grid_step(float coordinate, float origin, float steps_per_unit, float last) {
  return static_cast<unsigned>(fminf(fmaxf((coordinate - origin) * steps_per_unit, 0.0f), last));
}

struct BoundsSum {
  float min[3] = {kInfinity, kInfinity, kInfinity}, max[3] = {-kInfinity, -kInfinity, -kInfinity};
  unsigned valid = 0;
  __device__ void add(Point p) {
    const float v[3] = {p.x, p.y, p.z};
    for (int axis = 0; axis < 3; ++axis) {
      min[axis] = fminf(min[axis], v[axis]);
      max[axis] = fmaxf(max[axis], v[axis]);
    }
    ++valid;
  }
  // One atomic a block and number: all blocks meet in the same place.
  __device__ void publish(CloudState* state) {
    constexpr int kWarps = kKeyBlock / kWarp;
    __shared__ unsigned low[3][kWarps], high[3][kWarps], valid_of[kWarps];
    const unsigned warp = threadIdx.x / kWarp, lane = lane_number();
    for (int axis = 0; axis < 3; ++axis) {
      low[axis][warp] = warp_min(ordered(min[axis]));
      high[axis][warp] = warp_max(ordered(max[axis]));
    }
    valid_of[warp] = warp_sum(valid);
    __syncthreads();
    if (warp > 0) return;
    const bool holds = lane < kWarps;
    for (int axis = 0; axis < 3; ++axis) {
      const unsigned least = warp_min(holds ? low[axis][lane % kWarps] : ~0u);
      const unsigned most = warp_max(holds ? high[axis][lane % kWarps] : 0u);
      if (lane == 0 && least < state->min[axis]) atomicMin(&state->min[axis], least);
      if (lane == 0 && most > state->max[axis]) atomicMax(&state->max[axis], most);
    }
    const unsigned all_valid = warp_sum(holds ? valid_of[lane % kWarps] : 0u);
    if (lane == 0 && all_valid > 0) atomicAdd(&state->valid, all_valid);
  }
};

// The curve of src/point/curve.h, whose cube is in the state.
__global__ void lay_out(point::CurveCube cube, CloudState* state) {
  *state = CloudState{};
  state->origin[0] = cube.x;
  state->origin[1] = cube.y;
  state->origin[2] = cube.z;
  state->steps_per_unit = cube.inverse_side;
  for (unsigned& min : state->min) min = ~0u;
}

constexpr int kCurveBits = 2 * point::kDigitBits;  // kBits for that curve

// One bit more for the curve of balls, whose order must be exact: there invalid points have a bit of their own.
template <int kBits>
constexpr int kKeyBits = 3 * kBits + (kBits == kCurveBits ? 1 : 0);

// A cloud of fewer points is sorted by all bits of its keys but the lowest kRefinedBits, in three passes instead of
// four: on a surface the cells of 2^8 steps an axis then hold fewer points than a leaf. Where one holds more,
// the points are sorted by the other bits a block of kBoxBlock at a time.
constexpr std::size_t kFewPoints = 1 << 21;
constexpr int kRefinedBits = 6;

// The last keys, which only invalid points have: they must not share a cell with others.
template <class Key, int kBits>
constexpr Key kRefined = std::is_same_v<Key, CoarseKey> ? (Key(1) << kRefinedBits) - 1 : 0;

template <class Key, int kBits>
__device__ __forceinline__ Key key_of(const std::uint16_t* table, Point p, const float (&origin)[3], float scale) {
  if constexpr (kBits == kCurveBits) {
    const unsigned x = static_cast<unsigned>(point::curve_step(p.x, origin[0], scale)),
                   y = static_cast<unsigned>(point::curve_step(p.y, origin[1], scale)),
                   z = static_cast<unsigned>(point::curve_step(p.z, origin[2], scale));
    constexpr int kDigit = point::kDigitBits;
    constexpr unsigned kMask = (1u << kDigit) - 1;
    const Key first = hilbert_key<Key, kDigit>(table, x >> kDigit, y >> kDigit, z >> kDigit);
    return first << (3 * kDigit) | hilbert_key<Key, kDigit>(table, x & kMask, y & kMask, z & kMask);
  } else {
    constexpr Key kLast = (Key(1) << (3 * kBits)) - 1;
    constexpr float kLastStep = (1 << kBits) - 1;
    const Key key = hilbert_key<Key, kBits>(table, grid_step(p.x, origin[0], scale, kLastStep),
                                            grid_step(p.y, origin[1], scale, kLastStep),
                                            grid_step(p.z, origin[2], scale, kLastStep));
    return key < kLast - kRefined<Key, kBits> ? key : kLast - kRefined<Key, kBits> - 1;
  }
}

// Invalid points get the last key, which no valid point has, so they end up behind all others.
template <class Key, int kBits>
__global__ void __launch_bounds__(kKeyBlock)
    make_keys(const Point* points, std::size_t begin, std::size_t end, CloudState* state, Key* keys, Index* order) {
  constexpr Key kLast = (Key(1) << kKeyBits<kBits>)-1;
  __shared__ HilbertTable table;
  constexpr int kParts = sizeof(HilbertTable) / sizeof(uint4);
  for (int i = threadIdx.x; i < kParts; i += kKeyBlock)
    reinterpret_cast<uint4*>(&table)[i] = reinterpret_cast<const uint4*>(&kHilbertTable)[i];
  begin_kernel();
  __syncthreads();
  const float origin[3] = {state->origin[0], state->origin[1], state->origin[2]}, scale = state->steps_per_unit;
  BoundsSum bounds;
  for (std::size_t first = begin + std::size_t(blockIdx.x) * kKeysOfBlock; first < end;
       first += std::size_t(gridDim.x) * kKeysOfBlock) {
    Point p[kKeysAtOnce];
#pragma unroll
    for (int n = 0; n < kKeysAtOnce; ++n) {
      const std::size_t i = first + n * kKeyBlock + threadIdx.x;
      p[n] = i < end ? points[i] : Point{kInfinity, 0, 0};
    }
#pragma unroll
    for (int n = 0; n < kKeysAtOnce; ++n) {
      const std::size_t i = first + n * kKeyBlock + threadIdx.x;
      Key key = kLast;
      if (is_valid(p[n])) {
        key = key_of<Key, kBits>(table.entry, p[n], origin, scale);
        bounds.add(p[n]);
      }
      if (i < end) {
        keys[i] = key;
        order[i] = static_cast<Index>(i);
      }
    }
  }
  bounds.publish(state);
}

__device__ void store_box(BoxGroup& group, unsigned child, const Box& box, Index least_original) {
  const float bounds[6] = {box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z};
  for (int b = 0; b < 6; ++b) group.bound[b][child] = bounds[b];
  group.least_original[child] = least_original;
}

__device__ Box united_box(const Box& mine) { return {warp_box(mine.min, true).min, warp_box(mine.max, true).max}; }

// Sorts a block's pairs, one a thread, by their keys: a bitonic network (Batcher 1968).
__device__ void sort_block(CoarseKey& key, Index& value, uint2 (&shared)[kBoxBlock]) {
  const unsigned thread = threadIdx.x;
  for (unsigned run = 2; run <= kBoxBlock; run *= 2) {
    for (unsigned stride = run / 2; stride > 0; stride /= 2) {
      uint2 other;
      if (stride >= kWarp) {
        shared[thread] = {key, value};
        __syncthreads();
        other = shared[thread ^ stride];
        __syncthreads();
      } else {
        other = {__shfl_xor_sync(kAllLanes, key, stride), __shfl_xor_sync(kAllLanes, value, stride)};
      }
      const bool keeps_smaller = ((thread & run) == 0) == ((thread & stride) == 0);
      if (keeps_smaller ? other.x < key : other.x > key) key = other.x, value = other.y;
    }
  }
}

// See kFewPoints. `original` is that of sorted place i, and the block's places follow each other.
__device__ void refine(const CoarseKey* coarse, std::size_t i, Index valid, Index& original) {
  __shared__ uint2 pairs[kBoxBlock];
  CoarseKey key = i < valid ? coarse[i] : ~CoarseKey{0};
  pairs[threadIdx.x].x = key;
  __syncthreads();
  const unsigned leaf_on = threadIdx.x + kLeafSize;
  const bool is_dense = i < valid && leaf_on < kBoxBlock && pairs[leaf_on].x >> kRefinedBits == key >> kRefinedBits;
  if (__syncthreads_or(is_dense) != 0) sort_block(key, original, pairs);
}

// Brings the points into sorted order and makes the boxes of their leaves and of the level above. `coarse`: their keys,
// if they are to be refined, else null.
__global__ void __launch_bounds__(kBoxBlock)
    gather(const Point* points, std::size_t count, const Index* order, const CoarseKey* coarse,
           const __grid_constant__ Tree tree, float4* sorted) {
  __shared__ Box boxes[kWarp];
  __shared__ Index least[kWarp];
  begin_kernel();
  const std::size_t i = std::size_t(blockIdx.x) * kBoxBlock + threadIdx.x;
  const unsigned warp = threadIdx.x / kWarp;
  const bool valid = i < tree.state->valid;
  Index original = i < count ? order[i] : point::kNoNeighbor;
  if (coarse != nullptr) refine(coarse, i, tree.state->valid, original);
  const Point p = valid ? points[original] : Point{kInfinity, kInfinity, kInfinity};
  if (i / kLeafSize < tree.leaves) sorted[i] = {p.x, p.y, p.z, __uint_as_float(original)};
  const Box box = warp_box({p.x, p.y, p.z}, valid);
  const Index first = warp_min(valid ? original : point::kNoNeighbor);
  if (lane_number() == 0) {
    store_box(tree.group(0, blockIdx.x), warp, box, first);
    boxes[warp] = box;
    least[warp] = first;
  }
  __syncthreads();
  if (warp > 0 || tree.levels < 2) return;
  const Box above = united_box(boxes[threadIdx.x]);
  const Index first_above = warp_min(least[threadIdx.x]);
  if (threadIdx.x == 0) store_box(tree.group(1, blockIdx.x / kWarp), blockIdx.x % kWarp, above, first_above);
}

// The levels from 1 on, by one block: the places of each that no child fills, then the boxes of the next.
__global__ void __launch_bounds__(kBoxBlock) gather_upper_levels(const __grid_constant__ Tree tree, Index nodes) {
  begin_kernel();
  const Box nothing = {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
  for (int level = 1; level < tree.levels; ++level) {
    const Index groups = (nodes + kLeafSize - 1) / kLeafSize;
    const Index empty = nodes + threadIdx.x;
    if (empty < groups * kLeafSize)
      store_box(tree.group(level, empty / kLeafSize), empty % kLeafSize, nothing, point::kNoNeighbor);
    __syncthreads();
    for (Index node = threadIdx.x / kWarp; node < groups && level + 1 < tree.levels; node += kBoxBlock / kWarp) {
      const BoxGroup& children = tree.group(level, node);
      const Box box = united_box(box_of_lane(children));
      const Index least = warp_min(children.least_original[lane_number()]);
      if (lane_number() == 0) store_box(tree.group(level + 1, node / kLeafSize), node % kLeafSize, box, least);
    }
    nodes = groups;
    __syncthreads();
  }
}

}  // namespace

DeviceIndex::DeviceIndex(Context& context) : context_(context), state_(context), points_(context), groups_(context) {}

Tree DeviceIndex::tree() const {
  Tree tree{points_.data(), state_.data(), static_cast<Index>(leaves_), levels_, groups_.data(), {}, whole_};
  std::copy_n(first_group_, kMaxLevels, tree.first_group);
  return tree;
}

void DeviceIndex::build(const Point* points, std::size_t count, const std::optional<CurveCube>& cube,
                        const Arrival* arrival) {
  count_ = count;
  leaves_ = (count + kLeafSize - 1) / kLeafSize;
  state_.resize(1);
  points_.resize(leaves_ * kLeafSize);
  Sorted sorted(context_);
  constexpr std::size_t kManyPoints = 1 << 24;  // from here on cells of 2^10 steps an axis hold too many points each
  if (cube) {
    const auto [x, y, z] = cube->origin;
    lay_out<<<1, 1, 0, context_.stream()>>>(point::curve_cube({x, y, z}, cube->side), state_.data());
    check(cudaGetLastError(), "laying out the index");
    sort<std::uint64_t, kCurveBits>(points, arrival, sorted);
  } else if (count < kManyPoints) {
    sort<CoarseKey, 10>(points, arrival, sorted);
  } else {
    sort<std::uint64_t, 13>(points, arrival, sorted);
  }
  build_boxes(points, sorted);
}

namespace {

void start_prepare(const Point* points, std::size_t count, const Arrival* arrival, float steps, CloudState* state,
                   cudaStream_t stream) {
  const unsigned size = static_cast<unsigned>(std::min(count, std::size_t(kSample)));
  const std::size_t stride = count / std::max(size, 1u);
  if (arrival == nullptr) {
    prepare<<<1, kPrepareBlock, 0, stream>>>(EverySo{points, stride}, size, steps, state);
  } else {
    Brought brought;
    for (unsigned i = 0; i < size; ++i) brought.points[i] = arrival->source[i * stride];
    prepare<<<1, kPrepareBlock, 0, stream>>>(brought, size, steps, state);
  }
  check(cudaGetLastError(), "laying out the index");
}

// Two places for the keys and indices of a cloud, and sorting parts of it there.
template <class Key, int kBits>
class KeySort {
 public:
  struct Part {
    std::size_t begin, end;
    int place = 0;                                                   // where it is sorted
    Index count() const { return static_cast<Index>(end - begin); }  // 32 bits, else CUB takes smaller tiles
  };

  KeySort(Context& context, const Point* points, std::size_t count, CloudState* state)
      : context_(context),
        points_(points),
        state_(state),
        keys_{DeviceArray<Key>(context), DeviceArray<Key>(context)},
        order_{DeviceArray<Index>(context), DeviceArray<Index>(context)} {
    for (int i = 0; i < 2; ++i) {
      keys_[i].resize(count);
      order_[i].resize(count);
    }
  }

  void find_keys(std::size_t begin, std::size_t end) {
    const unsigned blocks = std::min(blocks_for(end - begin, kKeysOfBlock), unsigned(context_.processors()) * 8);
    launch_early(context_, "making sort keys", make_keys<Key, kBits>, blocks, kKeyBlock, points_, begin, end, state_,
                 keys_[0].data(), order_[0].data());
  }
  // By their keys, but for the lowest bits; equal ones as uploaded.
  Part sort(std::size_t begin, std::size_t end, int lowest_bit = 0) {
    Part part{begin, end};
    cub::DoubleBuffer<Key> keys(keys_[0].data() + begin, keys_[1].data() + begin);
    cub::DoubleBuffer<Index> order(order_[0].data() + begin, order_[1].data() + begin);
    with_scratch("sorting", [&](void* scratch, std::size_t& bytes) {
      return cub::DeviceRadixSort::SortPairs(scratch, bytes, keys, order, part.count(), lowest_bit, kKeyBits<kBits>,
                                             context_.stream());
    });
    part.place = keys.selector;
    return part;
  }
  void merge(const Part& a, const Part& b, Sorted& sorted) {
    sorted.order.resize(std::size_t(a.count()) + b.count());
    with_scratch("merging sorted parts", [&](void* scratch, std::size_t& bytes) {
      return cub::DeviceMerge::MergePairs(scratch, bytes, keys_[a.place].data() + a.begin,
                                          order_[a.place].data() + a.begin, a.count(), keys_[b.place].data() + b.begin,
                                          order_[b.place].data() + b.begin, b.count(), thrust::make_discard_iterator(),
                                          sorted.order.data(), ::cuda::std::less<Key>{}, context_.stream());
    });
  }
  void take(const Part& whole, Sorted& sorted) { sorted.order.swap(order_[whole.place]); }
  void take_coarse(const Part& whole, Sorted& sorted) {
    take(whole, sorted);
    sorted.coarse.swap(keys_[whole.place]);
  }

 private:
  // CUB's way: called without memory it says how much it needs.
  template <class Call>
  void with_scratch(const char* doing, const Call& call) {
    std::size_t bytes = 0;
    check(call(nullptr, bytes), doing);
    DeviceArray<std::byte> scratch(context_);
    scratch.resize(bytes);
    check(call(scratch.data(), bytes), doing);
  }

  Context& context_;
  const Point* points_;
  CloudState* state_;
  DeviceArray<Key> keys_[2];
  DeviceArray<Index> order_[2];
};

}  // namespace

// While the second part of a cloud arrives, the first gets its keys, and is sorted if that takes longer than the
// latency of a second sort and a merge, which at 1M points are as long as a sort of the whole.
template <class Key, int kBits>
void DeviceIndex::sort(const Point* points, const Arrival* arrival, Sorted& sorted) {
  constexpr std::size_t kWorthMerging = 1 << 24;
  if constexpr (kBits != kCurveBits)
    start_prepare(points, count_, arrival, float(1 << kBits), state_.data(), context_.stream());
  if (count_ == 0) return;
  KeySort<Key, kBits> sorter(context_, points, count_, state_.data());
  const std::size_t first_part = arrival != nullptr ? arrival->first_part : 0;
  const bool merges = first_part > 0 && count_ >= kWorthMerging;
  typename KeySort<Key, kBits>::Part first{};
  if (first_part > 0) {
    context_.wait_for(arrival->first);
    sorter.find_keys(0, first_part);
    if (merges) first = sorter.sort(0, first_part);
  }
  if (arrival != nullptr) context_.wait_for(arrival->all);
  sorter.find_keys(first_part, count_);
  if (merges) {
    sorter.merge(first, sorter.sort(first_part, count_), sorted);
    return;
  }
  if constexpr (std::is_same_v<Key, CoarseKey>) {
    if (count_ < kFewPoints) return sorter.take_coarse(sorter.sort(0, count_, kRefinedBits), sorted);
  }
  sorter.take(sorter.sort(0, count_), sorted);
}

void DeviceIndex::build_boxes(const Point* points, const Sorted& from) {
  std::size_t groups = blocks_for(leaves_, kLeafSize), all = groups;
  const Index groups_of_leaves = static_cast<Index>(groups);
  first_group_[0] = 0;
  for (levels_ = 1; groups > 1; ++levels_) {
    groups = blocks_for(groups, kLeafSize);
    first_group_[levels_] = static_cast<Index>(all);
    all += groups;
  }
  groups_.resize(all);
  launch_early(context_, "gathering points", gather, groups_of_leaves, kBoxBlock, points, count_, from.order.data(),
               from.coarse.data(), tree(), points_.data());
  if (levels_ < 2) return;
  launch_early(context_, "building the tree", gather_upper_levels, 1u, kBoxBlock, tree(), groups_of_leaves);
}

}  // namespace pointfair::cuda
