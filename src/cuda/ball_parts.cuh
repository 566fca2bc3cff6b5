// SPDX-License-Identifier: Apache-2.0
// What the balls of a leaf's 32 points hold, found once and read by every sum over balls that follows.
#pragma once

#include "cuda/memory.cuh"
#include "cuda/stop.cuh"
#include "cuda/tree.cuh"

namespace pointfair::cuda {

// Everything within a radius: R_i^2 = radius^2 + r_i^2, where r_i is the distance of point i to its `widening`-th
// nearest; the same radius for all if that is 0. A ball that would hold many more than kBallPoints points is thinned to
// about so many, by a hash of their positions. As in src/cpu/kernels.h.
struct Balls {
  const float* squared_radius;  // of each sorted point
  float squared_base;
  int widening;
  const float* squared_growth = nullptr;  // what multiplies R_i^2, of each sorted point; null: nothing
};
inline constexpr float kBallPoints = 400;

// Up to 32 points that lie in a ball of the leaf, in sorted order, and in whose.
struct BallPart {
  Index position[kWarp];   // kNoNeighbor behind the last
  unsigned inside[kWarp];  // by lane: bit i says that position[i] lies in its ball
};

// The parts of each leaf, chained in sorted order; `parts` is null where there are none and balls are walked instead.
struct CollectedBalls {
  const BallPart* parts;
  const Index* next;   // of each part, kNoNeighbor behind the last
  const Index* first;  // of each leaf, kNoNeighbor if its balls are empty
};

// Collects the parts of a cloud. Memory: 260 bytes a part; a leaf has a part for each 32 points that its balls hold.
class BallCollector {
 public:
  explicit BallCollector(Context& context);

  // Waits for the card. Falls back to no parts at all if they would take more than `largest` bytes, or memory is short.
  void collect(const Tree& tree, const Balls& balls, std::size_t largest, const Stop& stop);
  CollectedBalls collected() const;
  void release();

 private:
  bool make_room(std::size_t parts);  // false where memory is short
  std::size_t run(const Tree& tree, const Balls& balls, const Stop& stop);

  Context& context_;
  DeviceArray<BallPart> parts_;
  DeviceArray<Index> next_, first_, count_;
  bool complete_ = false;
};

}  // namespace pointfair::cuda
