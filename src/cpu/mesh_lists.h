// SPDX-License-Identifier: Apache-2.0
// Neighbour lists along the edges of a mesh, of a length of their own for each leaf. Memory: 4 bytes an
// entry; while they are found, 40 bytes a point and 4 more for each thread.
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "cpu/kernels.h"
#include "cpu/memory.h"
#include "seam/settings.hpp"

namespace pointfair::cpu {

class MeshLists {
 public:
  explicit MeshLists(MemoryMeter& meter) : meter_(&meter) {}
  MeshLists(MeshLists&& other) noexcept
      : meter_(other.meter_),
        blocks_(std::move(other.blocks_)),
        leaves_(std::move(other.leaves_)),
        bytes_(std::exchange(other.bytes_, 0)) {}
  MeshLists& operator=(MeshLists&& other) noexcept {
    std::swap(meter_, other.meter_);
    std::swap(blocks_, other.blocks_);
    std::swap(leaves_, other.leaves_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~MeshLists() { clear(); }

  // Of the points of an index, by settings.mesh. The squared radii are not read with settings.k; without it, the lists
  // of points whose neighbourhood is thinned (point::kept_share) hold that share.
  void find(const IndexView& index, const NeighborSettings& settings, const point::Radii& radii,
            const std::stop_token& stop);
  void clear() noexcept;

  // One for each leaf; null before find().
  const LeafLists* leaves() const { return leaves_.empty() ? nullptr : leaves_.data(); }

 private:
  MemoryMeter* meter_;
  std::vector<std::vector<Index>> blocks_;  // of leaves that were found together
  std::vector<LeafLists> leaves_;
  std::uint64_t bytes_ = 0;
};

}  // namespace pointfair::cpu
