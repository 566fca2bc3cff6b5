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
// clamped for the key only. `fresh`, if not null, is made that of an empty cloud.
__device__ void clear(CloudState& state) {
  state = CloudState{};
  for (unsigned& min : state.min) min = ~0u;
}
constexpr int kPrepareBlock = 6 * kWarp;  // a warp for each end of each axis
template <class Sampled>
__global__ void __launch_bounds__(kPrepareBlock)
    prepare(const __grid_constant__ Sampled sampled, unsigned size, float steps, KeyGrid* grid, CloudState* fresh) {
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
  if (fresh != nullptr) clear(*fresh);  // `grid` may be in it
  for (int a = 0; a < 3; ++a) grid->origin[a] = origin[a];
  grid->steps_per_unit = side > 0 && scale < kInfinity ? scale : 0;
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

// The curve of src/point/curve.h, over that cube.
__global__ void lay_out(point::CurveCube cube, CloudState* state) {
  clear(*state);
  state->grid = {{cube.x, cube.y, cube.z}, cube.inverse_side};
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

// Of invalid points; no valid one has it.
template <class Key, int kBits>
constexpr Key kInvalid = (Key(1) << kKeyBits<kBits>)-1;

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

// Invalid points get the last key, so they end up behind all others. Keys and order of point
// `offset` come first in their arrays.
template <class Key, int kBits>
__global__ void __launch_bounds__(kKeyBlock)
    make_keys(const Point* points, std::size_t begin, std::size_t end, const KeyGrid* grid, std::size_t offset,
              CloudState* state, Key* keys, Index* order) {
  __shared__ HilbertTable table;
  constexpr int kParts = sizeof(HilbertTable) / sizeof(uint4);
  for (int i = threadIdx.x; i < kParts; i += kKeyBlock)
    reinterpret_cast<uint4*>(&table)[i] = reinterpret_cast<const uint4*>(&kHilbertTable)[i];
  begin_kernel();
  __syncthreads();
  const float origin[3] = {grid->origin[0], grid->origin[1], grid->origin[2]}, scale = grid->steps_per_unit;
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
      Key key = kInvalid<Key, kBits>;
      if (is_valid(p[n])) {
        key = key_of<Key, kBits>(table.entry, p[n], origin, scale);
        bounds.add(p[n]);
      }
      if (i < end) {
        keys[i - offset] = key;
        order[i - offset] = static_cast<Index>(i);
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

// See kFewPoints. `original` is that of sorted place i of `end`, and the block's places follow each other.
__device__ void refine(const CoarseKey* coarse, std::size_t i, std::size_t end, Index& original) {
  __shared__ uint2 pairs[kBoxBlock];
  CoarseKey key = i < end ? coarse[i] : ~CoarseKey{0};
  pairs[threadIdx.x].x = key;
  __syncthreads();
  const unsigned leaf_on = threadIdx.x + kLeafSize;
  const bool is_dense =
      key < kInvalid<CoarseKey, 10> && leaf_on < kBoxBlock && pairs[leaf_on].x >> kRefinedBits == key >> kRefinedBits;
  if (__syncthreads_or(is_dense) != 0) sort_block(key, original, pairs);
}

// Brings points into sorted order and makes the boxes of their leaves and of the level above. `first`: a multiple of
// kBoxBlock, where `order` begins. `coarse`: their keys, if they are to be refined, else null.
__global__ void __launch_bounds__(kBoxBlock)
    gather(const Point* points, std::size_t first, std::size_t end, const Index* order, const CoarseKey* coarse,
           const __grid_constant__ Tree tree, float4* sorted) {
  __shared__ Box boxes[kWarp];
  __shared__ Index least[kWarp];
  begin_kernel();
  const std::size_t in_order = std::size_t(blockIdx.x) * kBoxBlock + threadIdx.x, i = first + in_order;
  const unsigned warp = threadIdx.x / kWarp;
  Index original = i < end ? order[in_order] : point::kNoNeighbor;
  if (coarse != nullptr) refine(coarse, in_order, end - first, original);
  Point p = i < end ? points[original] : Point{kInfinity, kInfinity, kInfinity};
  const bool valid = is_valid(p);
  if (!valid) p = {kInfinity, kInfinity, kInfinity};
  if (i / kLeafSize < tree.leaves) sorted[i] = {p.x, p.y, p.z, __uint_as_float(original)};
  const Box box = warp_box({p.x, p.y, p.z}, valid);
  const Index first_original = warp_min(valid ? original : point::kNoNeighbor);
  const Index group = static_cast<Index>(first / kBoxBlock) + blockIdx.x;
  if (lane_number() == 0) {
    store_box(tree.group(0, group), warp, box, first_original);
    boxes[warp] = box;
    least[warp] = first_original;
  }
  __syncthreads();
  if (warp > 0 || tree.levels < 2) return;
  const Box above = united_box(boxes[threadIdx.x]);
  const Index first_above = warp_min(least[threadIdx.x]);
  if (threadIdx.x == 0) store_box(tree.group(1, group / kWarp), group % kWarp, above, first_above);
}

__device__ Box nothing() { return {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}}; }

// The levels from 1 on, by one block, over the groups of leaves from `first`, which begins a subtree, to `end`: the
// places of each that no child fills, then the boxes of the next.
__global__ void __launch_bounds__(kBoxBlock)
    gather_upper_levels(const __grid_constant__ Tree tree, Index first, Index end) {
  begin_kernel();
  for (int level = 1; level < tree.levels; ++level) {
    const Index first_group = first / kLeafSize, end_group = (end + kLeafSize - 1) / kLeafSize;
    const Index empty = end + threadIdx.x;
    if (empty < end_group * kLeafSize)
      store_box(tree.group(level, empty / kLeafSize), empty % kLeafSize, nothing(), point::kNoNeighbor);
    __syncthreads();
    for (Index node = first_group + threadIdx.x / kWarp; node < end_group && level + 1 < tree.levels;
         node += kBoxBlock / kWarp) {
      const BoxGroup& children = tree.group(level, node);
      const Box box = united_box(box_of_lane(children));
      const Index least = warp_min(children.least_original[lane_number()]);
      if (lane_number() == 0) store_box(tree.group(level + 1, node / kLeafSize), node % kLeafSize, box, least);
    }
    first = first_group;
    end = end_group;
    __syncthreads();
  }
}

// The common levels over the subtrees from `first` to `end`, by one block; the others do not exist in this tree.
// `subtrees`: how many there are in all, and `level` that of their roots.
__device__ void build_top(const Tree& tree, int level, Index subtrees, Index first, Index end) {
  for (Index nodes = subtrees; ++level < tree.levels; nodes = (nodes + kLeafSize - 1) / kLeafSize) {
    const Index places = (nodes + kLeafSize - 1) / kLeafSize * kLeafSize;
    for (Index node = threadIdx.x / kWarp; node < places; node += kBoxBlock / kWarp) {
      Box box = nothing();
      Index least = point::kNoNeighbor;
      if (node >= first && node < end) {
        const BoxGroup& children = tree.group(level - 1, node);
        box = united_box(box_of_lane(children));
        least = warp_min(children.least_original[lane_number()]);
      }
      if (lane_number() == 0) store_box(tree.group(level, node / kLeafSize), node % kLeafSize, box, least);
    }
    first = 0;
    end = (nodes + kLeafSize - 1) / kLeafSize;
    __syncthreads();
  }
}

__global__ void __launch_bounds__(kBoxBlock)
    build_one_top(const __grid_constant__ Tree tree, int level, Index subtrees, Index end) {
  begin_kernel();
  build_top(tree, level, subtrees, 0, end);
}

// What is after each part, a block a part; the tops follow one another from that of `tree` on. Parts are `each`
// subtrees.
__global__ void __launch_bounds__(kBoxBlock)
    build_tops_after(const __grid_constant__ Tree tree, int level, Index subtrees, Index each, Index groups_of_top) {
  Tree its = tree;
  for (int l = level + 1; l < tree.levels; ++l) its.first_group[l] += blockIdx.x * groups_of_top;
  build_top(its, level, subtrees, (blockIdx.x + 1) * each, subtrees);
}

void start_prepare(Context& context, const Point* points, std::size_t count, const Arrival* arrival, float steps,
                   KeyGrid* grid, CloudState* fresh) {
  const unsigned size = static_cast<unsigned>(std::min(count, std::size_t(kSample)));
  const std::size_t stride = count / std::max(size, 1u);
  if (arrival == nullptr) {
    prepare<<<1, kPrepareBlock, 0, context.stream()>>>(EverySo{points, stride}, size, steps, grid, fresh);
  } else {
    Brought brought;
    for (unsigned i = 0; i < size; ++i) brought.points[i] = arrival->source[i * stride];
    prepare<<<1, kPrepareBlock, 0, context.stream()>>>(brought, size, steps, grid, fresh);
  }
  check(cudaGetLastError(), "laying out the index");
}

// Two places for the keys and indices of a cloud or one of its parts, and sorting there.
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
        order_{DeviceArray<Index>(context), DeviceArray<Index>(context)},
        scratch_(context) {
    for (int i = 0; i < 2; ++i) {
      keys_[i].resize(count);
      order_[i].resize(count);
    }
  }
  // All memory that sort(0, count) takes.
  void reserve(std::size_t count) { scratch_.resize(sort_bytes({0, count}, 0)); }

  // Point `offset` gets the first place.
  void find_keys(std::size_t begin, std::size_t end, const KeyGrid* grid, std::size_t offset = 0) {
    const unsigned blocks = std::min(blocks_for(end - begin, kKeysOfBlock), unsigned(context_.processors()) * 8);
    launch_early(context_, "making sort keys", make_keys<Key, kBits>, blocks, kKeyBlock, points_, begin, end, grid,
                 offset, state_, keys_[0].data(), order_[0].data());
  }
  // Those places by their keys, but for the lowest bits; equal ones as uploaded.
  Part sort(std::size_t begin, std::size_t end, int lowest_bit = 0) {
    Part part{begin, end};
    std::size_t bytes = sort_bytes(part, lowest_bit);
    scratch_.resize(bytes);
    call_sort(part, lowest_bit, scratch_.data(), bytes);
    return part;
  }
  void merge(const Part& a, const Part& b, Sorted& sorted) {
    sorted.order.resize(std::size_t(a.count()) + b.count());
    const auto call = [&](void* scratch, std::size_t& bytes) {
      check(cub::DeviceMerge::MergePairs(scratch, bytes, keys_[a.place].data() + a.begin,
                                         order_[a.place].data() + a.begin, a.count(), keys_[b.place].data() + b.begin,
                                         order_[b.place].data() + b.begin, b.count(), thrust::make_discard_iterator(),
                                         sorted.order.data(), ::cuda::std::less<Key>{}, context_.stream()),
            "merging sorted parts");
    };
    std::size_t bytes = 0;
    call(nullptr, bytes);
    scratch_.resize(bytes);
    call(scratch_.data(), bytes);
  }
  const Index* order(const Part& part) const { return order_[part.place].data() + part.begin; }
  const Key* keys(const Part& part) const { return keys_[part.place].data() + part.begin; }
  void take(const Part& whole, Sorted& sorted) { sorted.order.swap(order_[whole.place]); }
  void take_coarse(const Part& whole, Sorted& sorted) {
    take(whole, sorted);
    sorted.coarse.swap(keys_[whole.place]);
  }

 private:
  // CUB's way: called without memory it says how much it needs.
  std::size_t sort_bytes(Part part, int lowest_bit) {
    std::size_t bytes = 0;
    call_sort(part, lowest_bit, nullptr, bytes);
    return bytes;
  }
  void call_sort(Part& part, int lowest_bit, void* scratch, std::size_t& bytes) {
    cub::DoubleBuffer<Key> keys(keys_[0].data() + part.begin, keys_[1].data() + part.begin);
    cub::DoubleBuffer<Index> order(order_[0].data() + part.begin, order_[1].data() + part.begin);
    check(cub::DeviceRadixSort::SortPairs(scratch, bytes, keys, order, part.count(), lowest_bit, kKeyBits<kBits>,
                                          context_.stream()),
          "sorting");
    part.place = keys.selector;
  }

  Context& context_;
  const Point* points_;
  CloudState* state_;
  DeviceArray<Key> keys_[2];
  DeviceArray<Index> order_[2];
  DeviceArray<std::byte> scratch_;
};

}  // namespace

// Room to sort the largest part; each has a grid of its own for its keys, so that 10 bits an axis suffice.
class PartSort {
 public:
  using Keys = KeySort<CoarseKey, 10>;
  static constexpr float kSteps = 1 << 10;

  PartSort(Context& context, const Point* points, const Parts& parts, CloudState* state)
      : keys(context, points, parts.size(0), state), grids(context) {
    keys.reserve(parts.size(0));
    grids.resize(parts.count());
  }

  Keys keys;
  DeviceArray<KeyGrid> grids;
};

DeviceIndex::DeviceIndex(Context& context) : context_(context), state_(context), points_(context), groups_(context) {}
DeviceIndex::~DeviceIndex() { side_.reset(); }  // waits; then memory may be released

Tree DeviceIndex::tree() const { return own_levels_ < levels_ ? tree_with_top(parts_.count() - 1) : subtrees(); }

// The levels that no top is made for.
Tree DeviceIndex::subtrees() const {
  const Index leaves = static_cast<Index>(leaves_);
  Tree tree{points_.data(), state_.data(), leaves, leaves, std::min(levels_, own_levels_), groups_.data(), {}, whole_};
  std::copy_n(first_group_, kMaxLevels, tree.first_group);
  return tree;
}
Tree DeviceIndex::tree_with_top(std::size_t top) const {
  Tree tree = subtrees();
  tree.levels = levels_;
  for (int level = own_levels_; level < levels_; ++level)
    tree.first_group[level] += static_cast<Index>(top) * groups_of_top_;
  return tree;
}

LeafRange DeviceIndex::leaves_of(std::size_t part) const {
  return {static_cast<Index>(parts_.begin(part) / kLeafSize),
          static_cast<Index>((parts_.ends[part] + kLeafSize - 1) / kLeafSize)};
}
Tree DeviceIndex::tree_until(std::size_t part) const {
  Tree tree = tree_with_top(part);
  tree.leaves_there = leaves_of(part).end;
  return tree;
}
Tree DeviceIndex::tree_after(std::size_t part) const { return tree_with_top(parts_.count() + part); }

void DeviceIndex::join() {
  if (!is_in_parts()) return;
  side_->join();
  sort_.reset();
}

void DeviceIndex::build(const Point* points, std::size_t count, const std::optional<CurveCube>& cube,
                        const Arrival* arrival) {
  join();
  count_ = count;
  leaves_ = (count + kLeafSize - 1) / kLeafSize;
  state_.resize(1);
  points_.resize(leaves_ * kLeafSize);
  own_levels_ = kMaxLevels;
  groups_of_top_ = 0;
  if (arrival != nullptr && arrival->parts.apart && !cube) return build_parts(points, *arrival);
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

// While the second part of a cloud arrives, the first gets its keys, and is sorted if that takes longer than the
// latency of a second sort and a merge, which at 1M points are as long as a sort of the whole.
template <class Key, int kBits>
void DeviceIndex::sort(const Point* points, const Arrival* arrival, Sorted& sorted) {
  constexpr std::size_t kWorthMerging = 1 << 24;
  KeyGrid* const grid = &state_.data()->grid;
  if constexpr (kBits != kCurveBits)
    start_prepare(context_, points, count_, arrival, float(1 << kBits), grid, state_.data());
  if (count_ == 0) return;
  KeySort<Key, kBits> sorter(context_, points, count_, state_.data());
  const std::size_t first_part = arrival != nullptr && arrival->parts.count() > 1 ? arrival->parts.ends[0] : 0;
  const bool merges = first_part > 0 && count_ >= kWorthMerging;
  typename KeySort<Key, kBits>::Part first{};
  if (first_part > 0) {
    context_.wait_for(arrival->there[0]);
    sorter.find_keys(0, first_part, grid);
    if (merges) first = sorter.sort(0, first_part);
  }
  if (arrival != nullptr) context_.wait_for(arrival->all());
  sorter.find_keys(first_part, count_, grid);
  if (merges) {
    sorter.merge(first, sorter.sort(first_part, count_), sorted);
    return;
  }
  if constexpr (std::is_same_v<Key, CoarseKey>) {
    if (count_ < kFewPoints) return sorter.take_coarse(sorter.sort(0, count_, kRefinedBits), sorted);
  }
  sorter.take(sorter.sort(0, count_), sorted);
}

void DeviceIndex::lay_out_levels() {
  std::size_t groups = blocks_for(leaves_, kLeafSize), all = 0;
  for (levels_ = 0;; groups = blocks_for(groups, kLeafSize)) {
    first_group_[levels_] = static_cast<Index>(all);
    groups_of_[levels_++] = static_cast<Index>(groups);
    all += groups;
    if (groups == 1) break;
  }
  std::size_t tops = 1;
  if (own_levels_ < levels_) {
    groups_of_top_ = static_cast<Index>(all) - first_group_[own_levels_];
    tops = 2 * parts_.count() - 1;
  }
  groups_.resize(all + (tops - 1) * groups_of_top_);
}

void DeviceIndex::build_boxes(const Point* points, const Sorted& from) {
  lay_out_levels();
  launch_early(context_, "gathering points", gather, groups_of_[0], kBoxBlock, points, std::size_t{0}, count_,
               from.order.data(), from.coarse.data(), tree(), points_.data());
  if (levels_ < 2) return;
  launch_early(context_, "building the tree", gather_upper_levels, 1u, kBoxBlock, tree(), Index{0}, groups_of_[0]);
}

void DeviceIndex::build_parts(const Point* points, const Arrival& arrival) {
  parts_ = arrival.parts;
  const std::size_t each = parts_.size(0);
  own_levels_ = 1;
  for (std::size_t whole = kBoxBlock * kLeafSize; each % whole == 0; whole *= kLeafSize) ++own_levels_;
  lay_out_levels();
  sort_ = std::make_unique<PartSort>(context_, points, parts_, state_.data());
  if (!side_) side_.emplace(context_, Urgency::high);
  side_->fork();
  const OnStream side(context_, *side_);
  for (std::size_t part = 0; part < parts_.count(); ++part) {
    side_->wait_for(arrival.there[part]);
    build_part(points, part);
    ready_.record(part, side_->stream());
  }
  const Index own = static_cast<Index>(own_levels_), all = groups_of_[own - 1];
  const Index subtrees_each = leaves_of(0).count() >> (5 * own);
  build_tops_after<<<static_cast<unsigned>(parts_.count() - 1), kBoxBlock, 0, side_->stream()>>>(
      tree_after(0), own_levels_ - 1, all, subtrees_each, groups_of_top_);
  check(cudaGetLastError(), "building the tree");
  ready_.record(parts_.count(), side_->stream());
}

void DeviceIndex::build_part(const Point* points, std::size_t part) {
  const std::size_t begin = parts_.begin(part), end = parts_.ends[part];
  KeyGrid* const grid = sort_->grids.data() + part;
  start_prepare(context_, points + begin, end - begin, nullptr, PartSort::kSteps, grid,
                part == 0 ? state_.data() : nullptr);
  sort_->keys.find_keys(begin, end, grid, begin);
  const bool refines = end - begin < kFewPoints;
  const auto sorted = sort_->keys.sort(0, end - begin, refines ? kRefinedBits : 0);
  const Index first = static_cast<Index>(begin / kBoxBlock), last = blocks_for(end, kBoxBlock);
  launch_early(context_, "gathering points", gather, last - first, kBoxBlock, points, begin, end,
               sort_->keys.order(sorted), refines ? sort_->keys.keys(sorted) : nullptr, subtrees(), points_.data());
  if (own_levels_ > 1)
    launch_early(context_, "building the tree", gather_upper_levels, 1u, kBoxBlock, subtrees(), first, last);
  const Index all = groups_of_[own_levels_ - 1];
  Index until = blocks_for(leaves_of(part).end, kLeafSize);
  for (int level = 1; level < own_levels_; ++level) until = blocks_for(until, kLeafSize);
  launch_early(context_, "building the tree", build_one_top, 1u, kBoxBlock, tree_with_top(part), own_levels_ - 1, all,
               until);
}

}  // namespace pointfair::cuda
