// SPDX-License-Identifier: Apache-2.0
#include "cuda/index/boxes.cuh"
#include "cuda/runtime/launch.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = kGroupPoints;  // threads; 32 leaves, so a block also has the box of the level above
constexpr float kInfinity = __builtin_inff();

// Sorts a block's pairs, one a thread, by their keys: a bitonic network (Batcher 1968).
__device__ void sort_block(CoarseKey& key, Index& value, uint2 (&shared)[kBlock]) {
  const unsigned thread = threadIdx.x;
  for (unsigned run = 2; run <= kBlock; run *= 2) {
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
  __shared__ uint2 pairs[kBlock];
  CoarseKey key = i < end ? coarse[i] : ~CoarseKey{0};
  pairs[threadIdx.x].x = key;
  __syncthreads();
  const unsigned leaf_on = threadIdx.x + kLeafSize;
  const bool is_dense =
      key < kInvalid<CoarseKey, 10> && leaf_on < kBlock && pairs[leaf_on].x >> kRefinedBits == key >> kRefinedBits;
  if (__syncthreads_or(is_dense) != 0) sort_block(key, original, pairs);
}

// See gather_points().
__global__ void __launch_bounds__(kBlock)
    gather(const Point* points, std::size_t first, std::size_t end, const Index* order, const CoarseKey* coarse,
           const __grid_constant__ Tree tree, float4* sorted) {
  __shared__ Box boxes[kWarp];
  begin_kernel();
  const std::size_t in_order = std::size_t(blockIdx.x) * kBlock + threadIdx.x, i = first + in_order;
  const unsigned warp = threadIdx.x / kWarp;
  Index original = i < end ? order[in_order] : point::kNoNeighbor;
  if (coarse != nullptr) refine(coarse, in_order, end - first, original);
  Point p = i < end ? points[original] : Point{kInfinity, kInfinity, kInfinity};
  const bool valid = point::is_indexable(p);
  if (!valid) p = {kInfinity, kInfinity, kInfinity};
  if (i / kLeafSize < tree.leaves) sorted[i] = {p.x, p.y, p.z, __uint_as_float(original)};
  const Box box = warp_box({p.x, p.y, p.z}, valid);
  const Index group = static_cast<Index>(first / kBlock) + blockIdx.x;
  if (lane_number() == 0) {
    store_box(tree.group(0, group), warp, box);
    boxes[warp] = box;
  }
  __syncthreads();
  if (warp > 0 || tree.levels < 2) return;
  const Box above = united_box(boxes[threadIdx.x]);
  if (threadIdx.x == 0) store_box(tree.group(1, group / kWarp), group % kWarp, above);
}

// The levels from 1 on, by one block, over the groups of leaves from `first`, which begins a subtree, to `end`: the
// places of each that no child fills, then the boxes of the next.
__global__ void __launch_bounds__(kBlock)
    gather_upper_levels(const __grid_constant__ Tree tree, Index first, Index end) {
  begin_kernel();
  for (int level = 1; level < tree.levels; ++level) {
    const Index first_group = first / kLeafSize, end_group = (end + kLeafSize - 1) / kLeafSize;
    const Index empty = end + threadIdx.x;
    if (empty < end_group * kLeafSize) store_box(tree.group(level, empty / kLeafSize), empty % kLeafSize, nothing());
    __syncthreads();
    for (Index node = first_group + threadIdx.x / kWarp; node < end_group && level + 1 < tree.levels;
         node += kBlock / kWarp) {
      const Box box = united_box(box_of_lane(tree.group(level, node)));
      if (lane_number() == 0) store_box(tree.group(level + 1, node / kLeafSize), node % kLeafSize, box);
    }
    first = first_group;
    end = end_group;
    __syncthreads();
  }
}

// The common levels over the subtrees from `first` to `end`, by one block; the others do not exist in this tree.
// `subtrees`: how many there are in all, and `level` that of their roots.
__device__ void build_common(const Tree& tree, int level, Index subtrees, Index first, Index end) {
  for (Index nodes = subtrees; ++level < tree.levels; nodes = (nodes + kLeafSize - 1) / kLeafSize) {
    const Index places = (nodes + kLeafSize - 1) / kLeafSize * kLeafSize;
    for (Index node = threadIdx.x / kWarp; node < places; node += kBlock / kWarp) {
      Box box = nothing();
      if (node >= first && node < end) box = united_box(box_of_lane(tree.group(level - 1, node)));
      if (lane_number() == 0) store_box(tree.group(level, node / kLeafSize), node % kLeafSize, box);
    }
    first = 0;
    end = (nodes + kLeafSize - 1) / kLeafSize;
    __syncthreads();
  }
}

__global__ void __launch_bounds__(kBlock)
    build_one_top(const __grid_constant__ Tree tree, int level, Index subtrees, Index end) {
  begin_kernel();
  build_common(tree, level, subtrees, 0, end);
}

// What is after each part, a block a part; the tops follow one another from that of `tree` on. Parts are `each`
// subtrees.
__global__ void __launch_bounds__(kBlock) build_all_tops_after(const __grid_constant__ Tree tree, int level,
                                                               Index subtrees, Index each, Index groups_of_top) {
  Tree its = tree;
  for (int l = level + 1; l < tree.levels; ++l) its.first_group[l] += blockIdx.x * groups_of_top;
  build_common(its, level, subtrees, (blockIdx.x + 1) * each, subtrees);
}

}  // namespace

void gather_points(Context& context, const Point* points, std::size_t begin, std::size_t end, const Index* order,
                   const CoarseKey* coarse, const Tree& tree, float4* sorted) {
  const unsigned blocks = blocks_for(end, kGroupPoints) - static_cast<unsigned>(begin / kGroupPoints);
  launch_early(context, "gathering points", gather, blocks, kBlock, points, begin, end, order, coarse, tree, sorted);
}

void build_upper_levels(Context& context, const Tree& tree, Index first, Index end) {
  launch_early(context, "building the tree", gather_upper_levels, 1u, kBlock, tree, first, end);
}

void build_top(Context& context, const Tree& tree, int level, Index subtrees, Index end) {
  launch_early(context, "building the tree", build_one_top, 1u, kBlock, tree, level, subtrees, end);
}

void build_tops_after(Context& context, const Tree& tree, int level, Index subtrees, Index each, Index groups_of_top,
                      std::size_t parts) {
  launch(context, "building the tree", build_all_tops_after, static_cast<unsigned>(parts), kBlock, tree, level,
         subtrees, each, groups_of_top);
}

}  // namespace pointfair::cuda
