// SPDX-License-Identifier: Apache-2.0
// The index of many small clouds at once, none of which sees another: one tree (src/cuda/index/tree.cuh) in which every
// cloud has as many leaves as the largest needs, and a root of its own. Leaves without points end at once.
// Memory: as that of a cloud of `clouds` times the largest, rounded up to groups; 16 bytes a point while it is built,
// 48 with settings of clouds.
#pragma once

#include "cuda/index/boxes.cuh"
#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

// A cloud of a batch: its points in upload order, and how many points the clouds before it have.
struct CloudSpan {
  Index first, end, place;
};

struct CloudBatch {
  const CloudSpan* spans;         // on the card
  const CloudSettings* settings;  // on the card too; null: the same for all, and the fastest order
  Index clouds;                   // up to kMostClouds
  std::size_t largest;            // points of a cloud, up to kLargestCloud
  std::size_t points;             // of its clouds,
  std::size_t uploaded;           // and of all that were uploaded

  std::size_t groups_of_cloud() const { return blocks_for(largest, kGroupPoints); }
};
inline constexpr Index kMostClouds = 1 << 11;                           // that sort keys tell apart
inline constexpr std::size_t kLargestCloud = kLeafSize * kGroupPoints;  // whose groups are the children of a root

// The arrays that build_batch_index() fills, beside the groups of the tree.
struct BatchIndex {
  float4* sorted;
  CloudState* state;       // whose counts are those of all clouds together
  Index* valid_of_clouds;  // points
};
// Where the batch has settings of its clouds, the points of each lie along the curve of its own.
void build_batch_index(Context& context, const Point* points, const CloudBatch& batch, const Tree& tree,
                       const BatchIndex& to);

// The hash of each sorted position, relative to the corner of its cloud.
void hash_positions(Context& context, const Tree& tree, float* share);

// Applies the limits of each cloud (point::limited) to points on their way from `before` to `faired`; without
// `holds_back` there are no limits. All arrays are in upload order; `out` may be `faired`.
struct Moved {
  const Point *before, *faired;
  Point* out;
  bool holds_back;
};
void limit(Context& context, const CloudBatch& batch, const Moved& moved);

}  // namespace pointfair::cuda
