// SPDX-License-Identifier: Apache-2.0
// The boxes of the tree (src/cuda/index/tree.cuh), from sorted points up.
#pragma once

#include "cuda/index/sort_keys.cuh"
#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"

namespace pointfair::cuda {

inline constexpr int kGroupPoints = kLeafSize * kLeafSize;  // of leaves that have their boxes side by side

__device__ inline Box nothing() {
  constexpr float kMost = __builtin_inff();
  return {{kMost, kMost, kMost}, {-kMost, -kMost, -kMost}};
}
// Of all lanes.
__device__ inline Box united_box(const Box& mine) {
  return {warp_box(mine.min, true).min, warp_box(mine.max, true).max};
}
__device__ inline void store_box(BoxGroup& group, unsigned child, const Box& box) {
  const float bounds[6] = {box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z};
  for (int b = 0; b < 6; ++b) group.bound[b][child] = bounds[b];
}

// Brings points `begin` to `end` into sorted order, to `sorted`, and makes the boxes of their leaves and of the level
// above. `begin`: a multiple of kGroupPoints, where `order` begins. `coarse`: the keys, if they are to be refined (see
// kFewPoints), else null.
void gather_points(Context& context, const Point* points, std::size_t begin, std::size_t end, const Index* order,
                   const CoarseKey* coarse, const Tree& tree, float4* sorted);

// The levels from 1 on over the groups of leaves from `first`, which begins a subtree, to `end`.
void build_upper_levels(Context& context, const Tree& tree, Index first, Index end);

// The common levels over subtrees whose roots are on `level`, `subtrees` in all: of those before `end`, the others do
// not exist in this tree.
void build_top(Context& context, const Tree& tree, int level, Index subtrees, Index end);

// The same of what is after each of `parts` parts of `each` subtrees; the tops follow one another from that of `tree`
// on, `groups_of_top` groups each.
void build_tops_after(Context& context, const Tree& tree, int level, Index subtrees, Index each, Index groups_of_top,
                      std::size_t parts);

}  // namespace pointfair::cuda
