// SPDX-License-Identifier: Apache-2.0
// The points of a coarse scale: those whose position hashes low, and for all points the nearest among them.
#pragma once

#include <array>

#include "cuda/index/index.cuh"
#include "point/net.h"

namespace pointfair::cuda {

using ScaleCounts = std::array<Index, point::net::kScales>;
// How many points each scale has, those without a place left out. Waits for the card.
ScaleCounts count_scales(Context& context, const Tree& cloud);

// Memory: 25 bytes for each of its points, 16 more while they are chosen, 4 for each of the cloud.
class CoarsePoints {
 public:
  explicit CoarsePoints(Context& context) : context_(context), index_(context), place_(context), own_(context) {}

  // Of that scale of a cloud whose index has hashes.
  void choose(const Tree& cloud, int scale, Index count, const Frame& frame);
  // For every point of some leaves of the cloud the kNeighbors nearest others among them, as places in the cloud, to
  // lists as those of lists.cuh. There must be more than kNeighbors.
  void find_nearest(const Tree& cloud, LeafRange leaves, Index* lists) const;

 private:
  Context& context_;
  DeviceIndex index_;
  DeviceArray<Index> place_;  // of each sorted one in the cloud
  DeviceArray<Index> own_;    // of each place of the cloud among the sorted ones, kNoNeighbor of others
};

}  // namespace pointfair::cuda
