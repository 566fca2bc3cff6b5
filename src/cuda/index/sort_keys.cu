// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cub/device/device_radix_sort.cuh>

#include "cuda/index/curve_cells.cuh"
#include "cuda/index/dense_cells.cuh"
#include "cuda/index/hilbert.cuh"
#include "cuda/index/sort_keys.cuh"
#include "cuda/runtime/launch.cuh"
#include "point/rough_sample.h"

namespace pointfair::cuda {
namespace {

constexpr int kSample = 256;
constexpr int kKeyBlock = 256;
constexpr int kKeysAtOnce = 4;  // loads in flight
constexpr int kKeysOfBlock = kKeyBlock * kKeysAtOnce;
constexpr float kInfinity = __builtin_inff();

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

// One of each stretch of the points.
struct OfStretches {
  const Point* points;
  std::size_t length;
  __device__ Point operator[](unsigned i) const { return points[point::place_in_stretch(i, length)]; }
};

__device__ void clear(CloudState& state) {
  state = CloudState{};
  for (unsigned& min : state.min) min = ~0u;
}

// See lay_grid().
constexpr int kPrepareBlock = 6 * kWarp;  // a warp for each end of each axis
__global__ void __launch_bounds__(kPrepareBlock)
    prepare(OfStretches sampled, unsigned size, float steps, KeyGrid* grid, CloudState* fresh) {
  __shared__ float first[3], last[3], low[3], high[3];  // by axis: ends and quantiles
  begin_kernel();
  const unsigned axis = threadIdx.x / kWarp % 3;
  const bool upper = threadIdx.x / kWarp >= 3;
  Point points[Sample::kHeld] = {};  // all on their way at once
#pragma unroll
  for (int i = 0; i < Sample::kHeld && size > 0; ++i) points[i] = sampled[min(i * kWarp + lane_number(), size - 1)];
  Sample sample;
  int found = 0;
#pragma unroll
  for (int i = 0; i < Sample::kHeld; ++i) {
    const Point p = points[i];
    const bool valid = i * kWarp + lane_number() < size && point::is_indexable(p);
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

__global__ void lay_out(point::CurveCube cube, CloudState* state) {
  clear(*state);
  state->grid = {{cube.x, cube.y, cube.z}, cube.inverse_side};
}

// The last keys, which only invalid points have: they must not share a cell with others.
template <class Key, int kBits>
constexpr Key kRefined = std::is_same_v<Key, CoarseKey> ? (Key(1) << kRefinedBits) - 1 : 0;

template <class Key, int kBits>
__device__ __forceinline__ Key key_of(const std::uint16_t* table, Point p, const float (&origin)[3], float scale) {
  if constexpr (kBits == kCurveBits) {
    return curve_key<Key>(table, {p.x, p.y, p.z}, {origin[0], origin[1], origin[2], scale});
  } else {
    constexpr Key kLast = (Key(1) << (3 * kBits)) - 1;
    constexpr float kLastStep = (1 << kBits) - 1;
    const Key key = hilbert_key<Key, kBits>(table, grid_step(p.x, origin[0], scale, kLastStep),
                                            grid_step(p.y, origin[1], scale, kLastStep),
                                            grid_step(p.z, origin[2], scale, kLastStep));
    return key < kLast - kRefined<Key, kBits> ? key : kLast - kRefined<Key, kBits> - 1;
  }
}

// Invalid points get the last key, so they end up behind all others.
template <class Key, int kBits>
__global__ void __launch_bounds__(kKeyBlock)
    make_keys(const Point* points, std::size_t begin, std::size_t end, const KeyGrid* grid, CloudState* state,
              Key* keys, Index* order) {
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
      if (point::is_indexable(p[n])) {
        key = key_of<Key, kBits>(table.entry, p[n], origin, scale);
        bounds.add(p[n]);
      }
      if (i < end) {
        keys[i - begin] = key;
        order[i - begin] = static_cast<Index>(i);
      }
    }
  }
  bounds.publish(state);
}

}  // namespace

void lay_grid(Context& context, const Point* points, std::size_t count, float steps, KeyGrid* grid, CloudState* fresh) {
  const unsigned size = static_cast<unsigned>(std::min(count, std::size_t(kSample)));
  const std::size_t length = count / std::max(size, 1u);  // of a stretch
  launch(context, "laying out the index", prepare, 1, kPrepareBlock, OfStretches{points, length}, size, steps, grid,
         fresh);
}

void lay_grid(Context& context, point::CurveCube cube, CloudState* fresh) {
  launch(context, "laying out the index", lay_out, 1, 1, cube, fresh);
}

template <class Key, int kBits>
KeySort<Key, kBits>::KeySort(Context& context, const Point* points, std::size_t count, CloudState* state)
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

template <class Key, int kBits>
void KeySort<Key, kBits>::reserve(std::size_t count) {
  std::size_t bytes = 0;
  call_sort(count, 0, nullptr, bytes);
  scratch_.resize(bytes);
}

template <class Key, int kBits>
void KeySort<Key, kBits>::find_keys(std::size_t begin, std::size_t end, const KeyGrid* grid) {
  const unsigned blocks = std::min(blocks_for(end - begin, kKeysOfBlock), unsigned(context_.processors()) * 8);
  launch_early(context_, "making sort keys", make_keys<Key, kBits>, blocks, kKeyBlock, points_, begin, end, grid,
               state_, keys_[0].data(), order_[0].data());
}

template <class Key, int kBits>
void KeySort<Key, kBits>::sort(std::size_t count, int lowest_bit) {
  std::size_t bytes = 0;
  call_sort(count, lowest_bit, nullptr, bytes);
  scratch_.resize(bytes);
  call_sort(count, lowest_bit, scratch_.data(), bytes);
  if constexpr (kBits != kCurveBits)
    order_dense_cells<Key, kBits>(context_, points_, count, lowest_bit, keys_[place_].data(), order_[place_].data(),
                                  order_[1 - place_].data());
}

template <class Key, int kBits>
void KeySort<Key, kBits>::take_ordered(std::size_t count, Sorted& sorted)
  requires(kBits == kCurveBits)
{
  order_cells(context_, points_, keys(), count, order_[place_].data(), state_, order_[1 - place_].data());
  take(sorted);
}

// CUB's way: called without memory it says how much it needs. Counts of 64 bits make its tiles smaller.
template <class Key, int kBits>
void KeySort<Key, kBits>::call_sort(std::size_t count, int lowest_bit, void* scratch, std::size_t& bytes) {
  cub::DoubleBuffer<Key> keys(keys_[0].data(), keys_[1].data());
  cub::DoubleBuffer<Index> order(order_[0].data(), order_[1].data());
  check(cub::DeviceRadixSort::SortPairs(scratch, bytes, keys, order, static_cast<Index>(count), lowest_bit,
                                        kKeyBits<kBits>, context_.stream()),
        "sorting");
  place_ = keys.selector;
}

template class KeySort<CoarseKey, 10>;
template class KeySort<std::uint64_t, 13>;
template class KeySort<std::uint64_t, kCurveBits>;

}  // namespace pointfair::cuda
