// SPDX-License-Identifier: Apache-2.0
// The index as kernels see it. Points are sorted along a Hilbert curve; 32 consecutive points are a leaf; 32
// consecutive leaves have their boxes side by side, as have 32 consecutive groups of the next level, up to a level of
// at most 32. Boxes are tight, so the tree holds occupied space only and adapts to any density.
#pragma once

#include <cstddef>

#include "cuda/index/cloud_settings.cuh"
#include "cuda/runtime/warp.cuh"
#include "point/neighbors.h"

namespace pointfair::cuda {

inline constexpr int kLeafSize = kWarp;  // also the number of children of a node
inline constexpr int kMaxLevels = 6;     // 32^6 leaves of 32 are more than an Index can count

struct Box {
  Vec min, max;
};

// The boxes of 32 children side by side: min x, y, z, max x, y, z. Those of children that do not exist are inside out,
// at an infinite distance from everything.
struct BoxGroup {
  float bound[6][kLeafSize];
};

// A grid over which sort keys run.
struct KeyGrid {
  float origin[3], steps_per_unit;
};

// Facts about a cloud and its results that only the card knows until someone asks.
struct CloudState {
  KeyGrid grid;
  unsigned min[3], max[3];  // ordered() floats
  Index valid;
  Index long_cells;             // of the curve of src/point/curve.h (curve_cells.cuh)
  Index leaf_retries, retries;  // leaves and queries left to the exact searches
  unsigned long long too_few_neighbors, no_normal, short_neighborhoods;
};
// No gap, since the host copies every byte.
static_assert(offsetof(CloudState, too_few_neighbors) == offsetof(CloudState, retries) + sizeof(Index));

__device__ inline Vec position_of(float4 p) { return {p.x, p.y, p.z}; }
__device__ inline Index original_of(float4 p) { return __float_as_uint(p.w); }
__device__ inline bool is_present(float4 p) { return p.x < __int_as_float(0x7f800000); }

// Consecutive leaves, `end` behind the last.
struct LeafRange {
  Index begin, end;
  constexpr Index count() const { return end - begin; }
};

struct Tree {
  // Sorted, padded to whole leaves: x, y, z, original index as bits; infinite where invalid. The valid ones of a leaf
  // come first.
  const float4* points;
  const CloudState* state;
  Index leaves;
  Index leaves_there;  // of a cloud that is still arriving; those from here on must not be read
  int levels;
  BoxGroup* groups;  // of all levels
  Index
      first_group[kMaxLevels];  // level 0 has the boxes of leaves; group g has those of its children 32 g to 32 g + 31
  const float* share;           // of each sorted point, a hash of its position over [0, 1); null without a frame
  Index children;               // of a node above the groups of leaves: kLeafSize, or all groups of a batch's cloud
  // Of a batch (src/cuda/index/cloud_batch.cuh): every cloud has so many leaves, and a root of its own; 0 of one cloud.
  Index leaves_of_cloud;
  const Index* valid_of_clouds;   // of a batch
  const CloudSettings* settings;  // of each cloud of a batch where stages differ from cloud to cloud, else null

  __device__ bool holds(std::size_t at) const { return is_present(points[at]); }  // a valid point
  __device__ BoxGroup& group(int level, Index number) const { return groups[first_group[level] + number]; }
  // The group of the highest level over a leaf.
  __device__ Index root_over(Index leaf) const { return leaves_of_cloud == 0 ? 0 : leaf / leaves_of_cloud; }
  __device__ const CloudSettings* settings_over(Index leaf) const {
    return settings == nullptr ? nullptr : settings + root_over(leaf);
  }
  // Valid points of the cloud with that root.
  __device__ Index valid_under(Index root) const { return leaves_of_cloud == 0 ? state->valid : valid_of_clouds[root]; }
  __device__ Index first_child(int level, Index group) const { return group * (level == 0 ? kLeafSize : children); }
  // Those that are there of the leaf's cloud.
  __device__ LeafRange leaves_beside(Index leaf) const {
    if (leaves_of_cloud == 0) return {0, leaves_there};
    const Index first = root_over(leaf) * leaves_of_cloud;
    return {first, first + leaves_of_cloud};
  }
};

__device__ inline Box box_of_lane(const BoxGroup& group) {
  const float* b = &group.bound[0][lane_number()];
  return {{b[0], b[kLeafSize], b[2 * kLeafSize]}, {b[3 * kLeafSize], b[4 * kLeafSize], b[5 * kLeafSize]}};
}

__device__ inline float squared_gap(const Box& a, const Box& b) {
  return point::squared_gap(a.min, a.max, b.min, b.max);
}

// Of points in a child's box, none lies before this (point::lies_before).
__device__ inline Vec low_corner(const BoxGroup& group, unsigned child) {
  return {group.bound[0][child], group.bound[1][child], group.bound[2][child]};
}

// The order of neighbours in a list, as keys of their distances and places among the sorted points.
using Key = unsigned long long;
inline constexpr Key kNoKey = ~0ull;  // behind all others; its place is kNoNeighbor

// point::lies_before of two sorted points, one coordinate after the other: where registers are few.
__device__ inline bool lies_before(const float4* points, Index a, Index b) {
  const float* axis = &points->x;
  float p = 0, q = 0;
#pragma unroll 1
  for (int n = 0; n < 3 && p == q; ++n, ++axis) {
    p = axis[4 * std::size_t(a)];
    q = axis[4 * std::size_t(b)];
  }
  return p < q;
}

struct Precedes {
  const float4* points;
  __device__ bool operator()(Key a, Key b) const {
    return point::precedes(a, b, [this](Index at) { return position_of(points[at]); });
  }
};

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

// The whole warp walks the groups of leaves under boxes that are `near`, in sorted order; `near(group)` says so of the
// lane's box in a group, and may narrow on the way. Lane l remembers what is left to visit on level l. `root` is that
// of the cloud, 0 where there is one.
class GroupWalk {
 public:
  __device__ __forceinline__ GroupWalk(const Tree& tree, Index root) : tree_(tree), level_(tree.levels), group_(root) {}

  // Goes to the next group that has near leaves; false after the last, and not to be called again then.
  template <class Near>
  __device__ __forceinline__ bool next(Near near) {
    if (level_ == tree_.levels) {
      descend(tree_.levels - 1, group_, near);
    } else {
      pending_ = 0;
    }
    while (level_ > 0 || pending_ == 0) {
      if (pending_ == 0) {
        if (++level_ >= tree_.levels) return false;
        pending_ = __shfl_sync(kAllLanes, left_, level_);
        group_ = __shfl_sync(kAllLanes, left_group_, level_);
        continue;
      }
      const Index child = group_ * tree_.children + static_cast<Index>(__ffs(static_cast<int>(pending_)) - 1);
      pending_ &= pending_ - 1;
      if (static_cast<int>(lane_number()) == level_) {
        left_ = pending_;
        left_group_ = group_;
      }
      descend(level_ - 1, child, near);
    }
    return true;
  }
  __device__ Index first_leaf() const { return group_ * kLeafSize; }
  __device__ unsigned near_leaves() const { return pending_; }  // a bit each, from first_leaf() on

 private:
  template <class Near>
  __device__ __forceinline__ void descend(int level, Index group, Near near) {
    level_ = level;
    group_ = group;
    pending_ = __ballot_sync(kAllLanes, near(tree_.group(level, group)));
  }

  const Tree& tree_;
  int level_;
  Index group_;
  unsigned pending_ = 0, left_ = 0;
  Index left_group_ = 0;
};

// The same, leaf by leaf.
class Walk {
 public:
  __device__ __forceinline__ Walk(const Tree& tree, Index root) : groups_(tree, root) {}

  // The next leaf, or kNoNeighbor after the last; not to be called again then.
  template <class Near>
  __device__ __forceinline__ Index next(Near near) {
    if (pending_ == 0) {
      if (!groups_.next(near)) return point::kNoNeighbor;
      pending_ = groups_.near_leaves();
    }
    const Index leaf = groups_.first_leaf() + static_cast<Index>(__ffs(static_cast<int>(pending_)) - 1);
    pending_ &= pending_ - 1;
    return leaf;
  }

 private:
  GroupWalk groups_;
  unsigned pending_ = 0;
};

}  // namespace pointfair::cuda
