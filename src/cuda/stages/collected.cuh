// SPDX-License-Identifier: Apache-2.0
// The radius neighbourhoods of each group of eight points, found once and read by every sum over them that follows.
#pragma once

#include <functional>

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/stop.cuh"
#include "point/neighborhoods.h"

namespace pointfair::cuda {

// Points that follow each other along the curve. The neighbourhoods of eight together hold half to two thirds as many
// points as those of a leaf, so more of what a lane visits is its neighbour.
inline constexpr int kGroup = 8, kGroups = kWarp / kGroup;  // points; groups of a leaf
__device__ __forceinline__ unsigned group_of_lane() { return lane_number() / kGroup; }
__device__ __forceinline__ unsigned lane_in_group() { return lane_number() % kGroup; }

// Up to 32 points that lie in a neighbourhood of a group, in sorted order, and in whose.
struct NeighborPart {
  Index position[kWarp];    // kNoNeighbor behind the last
  unsigned inside[kGroup];  // of each of the group: bit i says that position[i] lies in its neighbourhood
};

// The parts of each group, chained in sorted order; `parts` is null where there are none and the tree is walked
// instead.
struct CollectedNeighbors {
  const NeighborPart* parts;
  const Index* next;   // of each part, kNoNeighbor behind the last
  const Index* first;  // of each group, kNoNeighbor if its neighbourhoods are empty
};

// Where the parts of all groups go.
struct PartsRoom {
  NeighborPart* parts;
  Index *next, *first;
  Index* count;  // of parts that are wanted, also beyond the capacity
  Index capacity;
};

class NeighborCollector;

// The memory of parts, which several collectors take in turns: only one iteration reads its neighbourhoods at a time.
// 164 bytes a part; a group has a part for each 32 points that its neighbourhoods hold.
class CollectedRoom {
 public:
  explicit CollectedRoom(Context& context) : parts_(context), next_(context) {}

  // Sets aside what a collector holds.
  void empty();

 private:
  friend class NeighborCollector;
  bool make(std::size_t parts);  // false where memory is short

  DeviceArray<NeighborPart> parts_;
  DeviceArray<Index> next_;
  NeighborCollector* holder_ = nullptr;
};

// Collects the parts of a cloud.
class NeighborCollector {
 public:
  NeighborCollector(Context& context, CollectedRoom& room);

  // Waits for the card. Falls back to no parts at all if they would take more than `largest` bytes, or memory is short.
  void collect(const Tree& tree, const point::Radii& radii, std::size_t largest, const Stop& stop);
  // The same of parts that `launch` writes; false where it falls back.
  bool collect(const Tree& tree, std::size_t largest, const std::function<void(const PartsRoom&)>& launch);
  CollectedNeighbors collected() const;
  // Forgets what it holds.
  void release();
  // As release(), but remembers that there was something, which collect() can bring back.
  void set_aside();
  bool is_aside() const { return is_aside_; }

 private:
  std::size_t run(const std::function<void(const PartsRoom&)>& launch);

  Context& context_;
  CollectedRoom& room_;
  DeviceArray<Index> first_, count_;
  double parts_of_leaf_;  // as many as there were in the mean, and some more; at first a guess
  bool complete_ = false, is_aside_ = false;
};

}  // namespace pointfair::cuda
