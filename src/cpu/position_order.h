// SPDX-License-Identifier: Apache-2.0
// Some points in the order of point::lies_before. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/pack.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// Points get keys of 128 steps an axis, x above y above z, and each point's rank is the number of smaller keys, counted
// a pack at a time without a branch. Positions that share a step are then put in order one by one; they are few.
class PositionOrder {
 public:
  static constexpr int kCapacity = (1 << 10) - kLanes;

  bool is_full() const { return count_ == kCapacity; }
  POINTFAIR_INLINE void append(point::Vec3<float> position, int at) {
    axis_[0][count_] = position.x;
    axis_[1][count_] = position.y;
    axis_[2][count_] = position.z;
    at_[count_++] = at;
  }

  // Writes what was appended, in order; `out` has room for it. Returns how many.
  int sort(int* out) {
    number();
    int order[kCapacity + kLanes];
    rank(order);
    for (int i = 1; i < count_; ++i) {
      const int moved = order[i];
      int slot = i;
      for (; slot > 0 && point::lies_before(position(moved), position(order[slot - 1])); --slot)
        order[slot] = order[slot - 1];
      order[slot] = moved;
    }
    for (int i = 0; i < count_; ++i) out[i] = at_[order[i]];
    return count_;
  }

 private:
  POINTFAIR_INLINE point::Vec3<float> position(int i) const { return {axis_[0][i], axis_[1][i], axis_[2][i]}; }

  // Keys, made different by the numbers below them, and beyond the last ones a pack that nothing is above.
  void number() {
    constexpr float kSteps = 127;
    float low[3], scale[3];
    for (int a = 0; a < 3; ++a) {
      Floats least = broadcast(axis_[a][0]), most = least;
      for (int i = 0; i < kLanes; ++i) axis_[a][count_ + i] = axis_[a][0];
      for (int i = 0; i < count_; i += kLanes) {
        const Floats here = load(axis_[a] + i);
        least = smaller(least, here);
        most = larger(most, here);
      }
      low[a] = smallest(least);
      const float range = largest(most) - low[a];
      scale[a] = range > 0 ? kSteps / range : 0;
    }
    const auto step = [&](int a, int i) {
      const FloatVector steps = ((load(axis_[a] + i) - broadcast(low[a])) * scale[a]).v;
      return __builtin_convertvector(steps, IntVector);
    };
    for (int i = 0; i < count_; i += kLanes) {
      const IntVector cell = step(0, i) << 14 | step(1, i) << 7 | step(2, i);
      store(reinterpret_cast<unsigned*>(key_ + i), Ints{cell << 10 | (lane_numbers().v + i)});
    }
  }

  // order[r] is the point of which r others have smaller keys.
  void rank(int* order) const {
    for (int i = 0; i < count_; i += kLanes) {
      const Ints mine = load(key_ + i);
      Ints ranks = broadcast(0);
      for (int j = 0; j < count_; ++j) ranks = select(broadcast(key_[j]) < mine, Ints{ranks.v + 1}, ranks);
      for (int lane = 0; lane < kLanes && i + lane < count_; ++lane) order[ranks.v[lane]] = i + lane;
    }
  }

  int count_ = 0;
  int at_[kCapacity];
  int key_[kCapacity + kLanes];
  float axis_[3][kCapacity + kLanes];
};

}  // namespace pointfair::cpu::POINTFAIR_ISA
