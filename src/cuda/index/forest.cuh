// SPDX-License-Identifier: Apache-2.0
// The index of many small clouds at once, none of which sees another: one tree (src/cuda/index/tree.cuh) in which every
// cloud has as many leaves as the largest needs, and a root of its own. Leaves without points end at once.
// Memory: as that of a cloud of `clouds` times the largest, rounded up to groups; 16 bytes a point while it is planted.
#pragma once

#include "cuda/index/boxes.cuh"
#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

struct Forest {
  const Index* ends;    // on the card: cloud i has the points ends[i - 1] to ends[i] in upload order
  Index clouds;         // up to kMostClouds
  std::size_t largest;  // points of a cloud, up to kLargestCloud
  std::size_t points;   // of all

  std::size_t groups_of_cloud() const { return blocks_for(largest, kGroupPoints); }
};
inline constexpr Index kMostClouds = 1 << 11;                           // that sort keys tell apart
inline constexpr std::size_t kLargestCloud = kLeafSize * kGroupPoints;  // whose groups are the children of a root

// Fills the tree and `state`, whose counts are those of all clouds together.
void plant(Context& context, const Point* points, const Forest& forest, const Tree& tree, float4* sorted,
           CloudState* state);

}  // namespace pointfair::cuda
