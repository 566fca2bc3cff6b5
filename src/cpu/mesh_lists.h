// SPDX-License-Identifier: Apache-2.0
// Neighbours along the edges of a mesh: rings as lists of each point, of a length of their own for each leaf, balls as
// what the points of a leaf reach together. Memory: 4 bytes an entry of a list, 8 a point that a leaf reaches; while
// they are found, 40 bytes a point and 8 more for each thread.
#pragma once

#include <cstdint>
#include <stop_token>
#include <utility>
#include <vector>

#include "cpu/kernels.h"
#include "cpu/memory.h"
#include "seam/settings.hpp"

namespace pointfair::cpu {

// Of leaves that were found together.
struct MeshBlock {
  std::vector<Index> at;                        // lists, or what is reached
  std::vector<std::uint16_t> lanes, in_radius;  // of balls
};

class MeshLists {
 public:
  explicit MeshLists(MemoryMeter& meter) : meter_(&meter) {}
  MeshLists(MeshLists&& other) noexcept : meter_(other.meter_) { *this = std::move(other); }
  MeshLists& operator=(MeshLists&& other) noexcept {
    std::swap(meter_, other.meter_);
    std::swap(blocks_, other.blocks_);
    std::swap(rings_, other.rings_);
    std::swap(balls_, other.balls_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~MeshLists() { clear(); }

  // Of the points of an index, by settings.mesh: rings with settings.k, which do not read the squared radii, or balls.
  // Where a ball is thinned (point::kept_share), it holds that share.
  void find(const IndexView& index, const NeighborSettings& settings, const point::Radii& radii,
            const std::stop_token& stop);
  void clear() noexcept;

  // One for each leaf; null where they were not found.
  const LeafLists* rings() const { return rings_.empty() ? nullptr : rings_.data(); }
  const LeafBalls* balls() const { return balls_.empty() ? nullptr : balls_.data(); }

 private:
  MemoryMeter* meter_;
  std::vector<MeshBlock> blocks_;
  std::vector<LeafLists> rings_;
  std::vector<LeafBalls> balls_;
  std::uint64_t bytes_ = 0;
};

}  // namespace pointfair::cpu
