// SPDX-License-Identifier: Apache-2.0
#include "cuda/index/boxes.cuh"
#include "cuda/index/dense_cells.cuh"
#include "cuda/index/hilbert.cuh"
#include "cuda/index/sort_keys.cuh"
#include "cuda/runtime/launch.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 1024;
constexpr int kWarps = kBlock / kWarp;
// Points of a cell that is dense. Where keys have lowest bits that are not sorted by, gather_points() sorts a group of
// leaves by them.
constexpr Index kDenseCell = kGroupPoints / 4, kDenseCoarseCell = kGroupPoints;
constexpr Index kStretch = 8 * kBlock;                 // places of a block
constexpr int kMostCells = 2 * kStretch / kDenseCell;  // whose first whole half begins there
constexpr int kBitsOfAxis = 4, kBins = 1 << (3 * kBitsOfAxis);
constexpr Index kManyPoints = 16 * kBlock;  // of a cell that is left as it is if a sample of them is in one place
constexpr int kMostWaiting = 256;           // cells of cells; what finds no room stays as it is

struct Places {
  Index begin, end;
  __device__ Index count() const { return end - begin; }
};

struct Memory {
  HilbertTable table;
  Index ends[kBins];  // of points in each bin and those before it
  Places waiting[kMostWaiting];
  int waits;
  Index cells[kMostCells];
  int found;
  float bound[6][kWarps];
  Index sum[kWarps];
};

// By all threads of a block, which pass a barrier at the end of each function that writes shared memory.
class CellSort {
 public:
  __device__ CellSort(Memory& memory, const Point* points, Index dense, Index* order, Index* spare)
      : memory_(memory), points_(points), dense_(dense), order_(order), spare_(spare) {}

  __device__ void sort(Places cell) {
    __syncthreads();  // all have seen that the cell before has nothing left waiting
    if (threadIdx.x == 0) {
      memory_.waiting[0] = cell;
      memory_.waits = 1;
    }
    __syncthreads();
    while (memory_.waits > 0) {
      const Places next = memory_.waiting[memory_.waits - 1];
      __syncthreads();
      if (threadIdx.x == 0) --memory_.waits;
      split(next);
    }
  }

 private:
  __device__ Vec position(Index place) const {
    const Point p = points_[order_[place]];
    return {p.x, p.y, p.z};
  }

  __device__ void split(Places cell) {
    if (cell.count() > kManyPoints && side_of(box_of(cell, cell.count() / kBlock)) == 0) return;
    const Box box = box_of(cell, 1);
    const float side = side_of(box), scale = (1 << kBitsOfAxis) / side;
    if (!(side > 0) || !(scale < __int_as_float(0x7f800000))) return;  // all in one place
    count_bins(cell, box.min, scale);
    add_up();
    for (Index i = cell.begin + threadIdx.x; i < cell.end; i += kBlock)
      spare_[cell.end - atomicAdd(&memory_.ends[bin_of(position(i), box.min, scale)], ~Index{0})] = order_[i];
    __syncthreads();
    for (Index i = cell.begin + threadIdx.x; i < cell.end; i += kBlock) order_[i] = spare_[i];
    note_dense_bins(cell);
  }

  __device__ static float side_of(const Box& box) {
    const Vec extent = box.max - box.min;
    return fmaxf(extent.x, fmaxf(extent.y, extent.z));
  }

  // Of every `step`th point.
  __device__ Box box_of(Places cell, Index step) const {
    constexpr float kInfinity = __builtin_inff();
    float bound[6] = {kInfinity, kInfinity, kInfinity, kInfinity, kInfinity, kInfinity};  // upper ones negated
    for (Index i = threadIdx.x; i < cell.count() / step; i += kBlock) {
      const Vec p = position(cell.begin + i * step);
      const float of_point[6] = {p.x, p.y, p.z, -p.x, -p.y, -p.z};
      for (int b = 0; b < 6; ++b) bound[b] = fminf(bound[b], of_point[b]);
    }
    const int warp = static_cast<int>(threadIdx.x / kWarp);
    for (int b = 0; b < 6; ++b) {
      const float least = unordered(warp_min(ordered(bound[b])));
      if (lane_number() == 0) memory_.bound[b][warp] = least;
    }
    __syncthreads();
    for (int b = 0; b < 6; ++b) bound[b] = unordered(warp_min(ordered(memory_.bound[b][lane_number()])));
    __syncthreads();
    return {{bound[0], bound[1], bound[2]}, {-bound[3], -bound[4], -bound[5]}};
  }

  __device__ unsigned bin_of(Vec p, Vec origin, float scale) const {
    constexpr float kLast = (1 << kBitsOfAxis) - 1;
    const auto step = [scale](float offset) { return static_cast<unsigned>(fminf(offset * scale, kLast)); };
    return hilbert_key<unsigned, kBitsOfAxis>(memory_.table.entry, step(p.x - origin.x), step(p.y - origin.y),
                                              step(p.z - origin.z));
  }

  __device__ void count_bins(Places cell, Vec origin, float scale) {
    for (int bin = threadIdx.x; bin < kBins; bin += kBlock) memory_.ends[bin] = 0;
    __syncthreads();
    for (Index i = cell.begin + threadIdx.x; i < cell.end; i += kBlock)
      atomicAdd(&memory_.ends[bin_of(position(i), origin, scale)], 1u);
    __syncthreads();
  }

  // Counts from the last bin down: places are given away from the end of the cell.
  __device__ void add_up() {
    constexpr int kOfThread = kBins / kBlock;
    Index* const mine = memory_.ends + kBins - kOfThread * (threadIdx.x + 1);
    Index sum = 0;
    for (int i = kOfThread - 1; i >= 0; --i) mine[i] = sum += mine[i];
    const int warp = static_cast<int>(threadIdx.x / kWarp);
    const Index of_warp = up_to_lane(sum);
    if (lane_number() == kWarp - 1) memory_.sum[warp] = of_warp;
    __syncthreads();
    const Index warps = up_to_lane(memory_.sum[lane_number()]);
    const Index before = warp > 0 ? __shfl_sync(kAllLanes, warps, warp - 1) : 0u;
    for (int i = 0; i < kOfThread; ++i) mine[i] += before + of_warp - sum;
    __syncthreads();
  }
  __device__ static Index up_to_lane(Index value) {
    for (unsigned step = 1; step < kWarp; step *= 2) {
      const Index other = __shfl_up_sync(kAllLanes, value, step);
      if (lane_number() >= step) value += other;
    }
    return value;
  }

  // Now that all places are given away, each bin ends where the next one's places began.
  __device__ void note_dense_bins(Places cell) {
    for (int bin = threadIdx.x; bin < kBins; bin += kBlock) {
      const Index above = memory_.ends[bin], all = bin > 0 ? memory_.ends[bin - 1] : cell.count();
      if (all - above < dense_) continue;
      const int at = atomicAdd(&memory_.waits, 1);
      if (at < kMostWaiting) memory_.waiting[at] = {cell.end - all, cell.end - above};
    }
    __syncthreads();
    if (threadIdx.x == 0 && memory_.waits > kMostWaiting) memory_.waits = kMostWaiting;
    __syncthreads();
  }

  Memory& memory_;
  const Point* points_;
  Index dense_;
  Index *order_, *spare_;
};

// The cell that place `in` is in: halves the places before and behind it until both ends are known.
template <class Key>
__device__ Places cell_around(const Key* keys, Index in, Index count, int lowest_bit) {
  const Key cell = keys[in] >> lowest_bit;
  const auto is_in = [&](Index i) { return keys[i] >> lowest_bit == cell; };
  Index first = in, last = in;
  for (Index before = 0; before < first;) {
    const Index middle = before + (first - before) / 2;
    if (is_in(middle))
      first = middle;
    else
      before = middle + 1;
  }
  for (Index behind = count; behind - last > 1;) {
    const Index middle = last + (behind - last) / 2;
    (is_in(middle) ? last : behind) = middle;
  }
  return {first, last + 1};
}

template <class Key, int kBits>
__global__ void __launch_bounds__(kBlock)
    order_cells_of_stretch(const Point* points, Index count, Index dense, int lowest_bit, Key* keys, Index* order,
                           Index* spare) {
  __shared__ Memory memory;
  if (threadIdx.x == 0) memory.found = 0;
  __syncthreads();
  begin_kernel();
  // A dense cell holds all of one or more halves that begin at multiples of their length; the first of them finds it.
  const Index half = dense / 2, begin = blockIdx.x * kStretch + threadIdx.x * half;
  if (threadIdx.x < kStretch / half && begin + half <= count) {
    const Key key = keys[begin] >> lowest_bit, last = keys[begin + half - 1] >> lowest_bit,
              before = begin > 0 ? keys[begin - half] >> lowest_bit : ~Key{0};
    if (key == last && key != before && key != kInvalid<Key, kBits> >> lowest_bit)
      memory.cells[atomicAdd(&memory.found, 1)] = begin;
  }
  __syncthreads();
  if (memory.found == 0) return;
  constexpr int kParts = sizeof(HilbertTable) / sizeof(uint4);
  for (int i = threadIdx.x; i < kParts; i += kBlock)
    reinterpret_cast<uint4*>(&memory.table)[i] = reinterpret_cast<const uint4*>(&kHilbertTable)[i];
  __syncthreads();
  CellSort cells(memory, points, dense, order, spare);
  for (int n = 0; n < memory.found; ++n) {
    const Places cell = cell_around(keys, memory.cells[n], count, lowest_bit);
    if (cell.count() < dense) continue;
    cells.sort(cell);
    if (lowest_bit == 0) continue;
    for (Index i = cell.begin + threadIdx.x; i < cell.end; i += kBlock) keys[i] = keys[i] >> lowest_bit << lowest_bit;
  }
}

}  // namespace

template <class Key, int kBits>
void order_dense_cells(Context& context, const Point* points, std::size_t count, int lowest_bit, Key* keys,
                       Index* order, Index* spare) {
  const Index dense = lowest_bit > 0 ? kDenseCoarseCell : kDenseCell;
  if (count < dense) return;
  launch_early(context, "ordering dense cells", order_cells_of_stretch<Key, kBits>, blocks_for(count, kStretch), kBlock,
               points, static_cast<Index>(count), dense, lowest_bit, keys, order, spare);
}

template void order_dense_cells<CoarseKey, 10>(Context&, const Point*, std::size_t, int, CoarseKey*, Index*, Index*);
template void order_dense_cells<std::uint64_t, 13>(Context&, const Point*, std::size_t, int, std::uint64_t*, Index*,
                                                   Index*);

}  // namespace pointfair::cuda
