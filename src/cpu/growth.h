// SPDX-License-Identifier: Apache-2.0
// grow_constrained (src/point/neighbors.h) for the points of a leaf, a pack at a time. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/pack.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// One pack's neighbourhoods while they grow.
class PackGrowth {
 public:
  static constexpr int kMaxCandidates = 1024;

  POINTFAIR_INLINE PackGrowth(const IndexView& index, Index start, const Index* candidates, int k, float reach,
                              Index* list)
      : index_(index), candidates_(candidates), k_(k), reach_(reach), list_(list) {
    here_ = {load(index.x + start), load(index.y + start), load(index.z + start)};
    active_ = lane_numbers() < broadcast(int(index.points - start));
    for (int s = 0; s < k; ++s) store(list + s * kLeafSize, broadcast(int(point::kNoNeighbor)));
  }

  // Bit l is set if no candidate beyond those given could join lane l's neighbourhood.
  unsigned run(int candidates) {
    Mask given = active_;
    for (int i = 0; i < candidates && any(unfinished() & given); ++i) given = offer(i, given);
    const Mask beyond_reach = ~(square_root(last_) < square_root(farthest_) + reach_);
    return bits(~active_ | ~given | (count_ == broadcast(k_)) | beyond_reach);
  }

 private:
  POINTFAIR_INLINE Mask unfinished() const { return active_ & (count_ < broadcast(k_)); }

  // Returns the lanes that still had a candidate.
  POINTFAIR_INLINE Mask offer(int i, Mask given) {
    const Ints listed = load(candidates_ + i * kLeafSize);
    given = given & (listed != broadcast(int(point::kNoNeighbor)));
    const Ints at = select(given, listed, broadcast(0));
    offset_[i] = point::Vec3<Floats>{gather(index_.x, at), gather(index_.y, at), gather(index_.z, at)} - here_;
    const Floats squared = point::squared_length(offset_[i]);
    const Mask wanted = given & unfinished();
    last_ = select(wanted, squared, last_);
    const Floats squared_reach = broadcast(reach_ * reach_);
    Mask joins = squared < squared_reach;
    for (int j = i - 1; j >= 0 && any(wanted & ~joins); --j)
      joins = joins | (joined_[j] & (point::squared_length(offset_[i] - offset_[j]) < squared_reach));
    joined_[i] = joins & wanted;
    append(joined_[i], listed, squared);
    return given;
  }

  POINTFAIR_INLINE void append(Mask joined, Ints listed, Floats squared) {
    for (unsigned lanes = bits(joined); lanes != 0; lanes &= lanes - 1) {
      const int lane = __builtin_ctz(lanes);
      list_[count_.v[lane] * kLeafSize + lane] = Index(listed.v[lane]);
    }
    count_ = select(joined, Ints{count_.v + 1}, count_);
    farthest_ = select(joined, squared, farthest_);
  }

  const IndexView& index_;
  const Index* candidates_;
  int k_;
  float reach_;
  Index* list_;
  point::Vec3<Floats> here_;
  Mask active_;
  Ints count_ = broadcast(0);
  Floats farthest_ = broadcast(0.0f), last_ = broadcast(0.0f);  // squared distances: last member, last candidate
  point::Vec3<Floats> offset_[kMaxCandidates];
  Mask joined_[kMaxCandidates];
};

inline unsigned grow(const IndexView& index, Index leaf, const Index* candidates, int count, int k, float reach,
                     Index* list) {
  unsigned complete = 0;
  for (int part = 0; part < kLeafSize; part += kLanes) {
    PackGrowth growth(index, leaf * kLeafSize + Index(part), candidates + part, k, reach, list + part);
    complete |= growth.run(count) << part;
  }
  return complete;
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
