// SPDX-License-Identifier: Apache-2.0
// The index as kernels see it. Points are sorted along a Hilbert curve; 32 consecutive points are a leaf; 32
// consecutive leaves have their boxes side by side, as have 32 consecutive groups of the next level, up to a level of
// at most 32. Boxes are tight, so the tree holds occupied space only and adapts to any density.
#pragma once

#include "cuda/warp.cuh"
#include "point/neighbors.h"

namespace pointfair::cuda {

using point::Index;
using Vec = point::Vec3<float>;

inline constexpr int kLeafSize = kWarp;  // also the number of children of a node
inline constexpr int kMaxLevels = 6;     // 32^6 leaves of 32 are more than an Index can count

struct Box {
  Vec min, max;
};

// Boxes of one level: six arrays of `stride` floats (min x, y, z, max x, y, z); boxes that do not exist are inside out,
// at an infinite distance from everything. `least_original` breaks ties among points at the same distance.
struct Level {
  float* boxes;
  Index* least_original;
  Index stride;  // a multiple of 32
};

// Facts about a cloud and its results that only the card knows until someone asks.
struct CloudState {
  float origin[3], steps_per_unit;  // of the sort key's grid
  unsigned min[3], max[3];          // ordered() floats
  Index valid;                      // these come first in sorted order
  Index retries;                    // queries left to the exact search
  unsigned long long too_few_neighbors, no_normal, short_neighborhoods;
};

struct Tree {
  const float4* points;  // sorted, padded to whole leaves: x, y, z, original index as bits; infinite where invalid
  const CloudState* state;
  Index leaves;
  int levels;
  Level level[kMaxLevels];
};

__device__ inline Vec position_of(float4 p) { return {p.x, p.y, p.z}; }
__device__ inline Index original_of(float4 p) { return __float_as_uint(p.w); }

__device__ inline Box box_of_child(const Level& level, Index child) {
  const float* b = level.boxes + child;
  const std::size_t stride = level.stride;
  return {{b[0], b[stride], b[2 * stride]}, {b[3 * stride], b[4 * stride], b[5 * stride]}};
}

__device__ inline float squared_gap(const Box& a, const Box& b) {
  return point::squared_gap(a.min, a.max, b.min, b.max);
}

// The box of the lanes' points where `inside`; inside out if there are none.
__device__ inline Box warp_box(Vec p, bool inside) {
  const auto least = [inside](float v) {
    return unordered(warp_min(inside ? ordered(v) : ordered(__int_as_float(0x7f800000))));
  };
  const auto most = [inside](float v) {
    return unordered(warp_max(inside ? ordered(v) : ordered(__int_as_float(0xff800000))));
  };
  return {{least(p.x), least(p.y), least(p.z)}, {most(p.x), most(p.y), most(p.z)}};
}

// Where a warp stands on its way down the tree; one per warp in shared memory.
struct WalkStack {
  unsigned near[kMaxLevels];  // children still to be visited
  Index group[kMaxLevels];    // whose they are
};

// The whole warp walks the leaves under boxes that are `near(box)`, in sorted order; `near` may narrow on the way.
class Walk {
 public:
  __device__ __forceinline__ Walk(const Tree& tree, WalkStack& stack)
      : tree_(tree), stack_(stack), level_(tree.levels) {}

  // The next leaf, or kNoNeighbor after the last.
  template <class Near>
  __device__ __forceinline__ Index next(Near near) {
    if (level_ == tree_.levels && group_ == 0) descend(tree_.levels - 1, 0, near);
    while (level_ < tree_.levels) {
      if (pending_ == 0) {
        if (++level_ == tree_.levels) break;
        pending_ = stack_.near[level_];
        group_ = stack_.group[level_];
        continue;
      }
      const Index child = group_ * kLeafSize + static_cast<Index>(__ffs(static_cast<int>(pending_)) - 1);
      pending_ &= pending_ - 1;
      if (level_ == 0) return child;
      stack_.near[level_] = pending_;  // the same value from every lane
      stack_.group[level_] = group_;
      __syncwarp();
      descend(level_ - 1, child, near);
    }
    group_ = point::kNoNeighbor;
    return point::kNoNeighbor;
  }

 private:
  template <class Near>
  __device__ __forceinline__ void descend(int level, Index group, Near near) {
    level_ = level;
    group_ = group;
    pending_ = __ballot_sync(kAllLanes, near(box_of_child(tree_.level[level], group * kLeafSize + lane_number())));
  }

  const Tree& tree_;
  WalkStack& stack_;
  int level_;
  Index group_ = 0;
  unsigned pending_ = 0;
};

}  // namespace pointfair::cuda
