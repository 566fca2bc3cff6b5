// SPDX-License-Identifier: Apache-2.0
// The nearest candidates of each lane of a group of queries. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/network.h"
#include "cpu/pack.h"
#include "cpu/position_order.h"

namespace pointfair::cpu::POINTFAIR_ISA {

inline constexpr float kInfinity = __builtin_inff();

// The lanes of a leaf that search together, their common box, and how far each still has to look.
struct Queries {
  point::Vec3<Floats> position;
  point::Vec3<Floats> min, max;  // of the active lanes, the same in every lane
  Ints at;                       // sorted positions of the queries
  Floats limit;                  // candidates beyond do not count; -1 in idle lanes
};

// K sorted lists, one a lane, in registers as far as they go. An entry is one number: the bits of the squared distance,
// the lowest of them replaced by the candidate's number in this walk. Non-negative floats order as their bits, so lists
// are kept by minima and maxima alone. Two slots more than asked for make it rare that the shortened distances cannot
// tell the k nearest from the rest; `finish` then says so, and ExactLists decides.
template <int K>
class FastLists {
 public:
  static constexpr bool kOrdersTies = false, kTakesEquals = true;
  static constexpr int kBatch = 48;  // candidates to collect before they are offered

  POINTFAIR_INLINE explicit FastLists(int k) : k_(k) {}
  POINTFAIR_INLINE void clear() {
    for (Ints& entry : entry_) entry = broadcast(kEmpty);
    candidates_ = 0;
  }
  // The k-th distance, or a little more.
  POINTFAIR_INLINE Floats last() const { return as_floats(entry_[k_ - 1] | kNumber); }
  POINTFAIR_INLINE bool all_identical() const { return any(entry_[K - 1] < broadcast(kNumber + 1)); }
  // There are more candidates than numbers, so entries no longer name one.
  POINTFAIR_INLINE bool overflown() const { return candidates_ > kNumber; }

  // Offers the points at `count` <= kMaxBatch sorted positions; those farther than `bound` do not count. First all
  // distances, then all insertions: neither part has a branch to mispredict.
  template <bool kOwn>
  void offer(const IndexView& index, const Queries& queries, Floats bound, const int* positions, int count) {
    Ints useful[kMaxBatch];
    const point::Vec3<Floats> here = queries.position;  // not read again at each candidate, as clang would
    int n = 0;
    for (int i = 0; i < count; ++i) {
      const int at = positions[i];
      const Floats distance = point::squared_length(spread(index.x[at], index.y[at], index.z[at]) - here);
      Mask hit = distance <= bound;
      if constexpr (kOwn) hit = hit & (queries.at != broadcast(at));
      const int number = (candidates_ + n) & kNumber;
      position_[number] = at;
      useful[n] = select(hit, shortened(as_ints(distance)) | number, broadcast(kEmpty));
      n += any(hit);  // the next one takes this place if nobody wants it
    }
    candidates_ += n;
    if constexpr (K <= 16) {
      for (int i = 0; i < n; ++i) insert(useful[i]);
    } else {
      for (; n % kRound != 0; ++n) useful[n] = broadcast(kEmpty);
#if defined(__clang__)  // of a member it would write back each comparison; g++ does not, and copies take it longer
      Ints entries[kSlots];
      __builtin_memcpy(entries, entry_, sizeof entries);
      for (int i = 0; i < n; i += kRound) merge(entries, useful + i);
      __builtin_memcpy(entry_, entries, sizeof entries);
#else
      for (int i = 0; i < n; i += kRound) merge(entry_, useful + i);
#endif
    }
  }

  // Orders the first k of the active lanes exactly. False if it is not certain which they are.
  bool finish(const IndexView& index, const Queries& queries, int k, Mask active) {
    const Ints beyond = shortened(entry_[kSlots - 1]);
    const bool is_certain = !any((beyond == shortened(entry_[k - 1])) & (beyond < broadcast(kEmpty)) & active);
    if (!is_certain) return offer_in_order(index, queries, k);
    int ties = 0;
    for (int s = 1; s < kSlots; ++s) {
      const Ints here = shortened(entry_[s]);
      const Mask equal = (here == shortened(entry_[s - 1])) & (here < broadcast(kEmpty)) & active;
      for (unsigned lanes = bits(equal); lanes != 0; lanes &= lanes - 1) {
        if (++ties == kManyTies && offer_in_order(index, queries, k)) return true;
        put_in_order(index, queries, __builtin_ctz(lanes), s);
      }
    }
    return true;
  }
  POINTFAIR_INLINE Ints at(int s) const {
    const Mask found = entry_[s] < broadcast(kEmpty);
    return select(found, gather(position_, entry_[s] & kNumber), broadcast(int(point::kNoNeighbor)));
  }

  static constexpr int kMaxBatch = kBatch + kLeafSize;

 private:
  static constexpr int kSlots = K + 2;
  static constexpr int kRound = 16;                                                          // merged together
  static constexpr int kNumber = (1 << (K <= 8 ? 8 : K <= 16 ? 9 : K <= 32 ? 10 : 11)) - 1;  // the number's bits
  static constexpr int kEmpty = 0x7f7fffff & ~kNumber;                                       // above every distance

  static constexpr int kManyTies = kLanes;  // fewer are put in order one by one

  static POINTFAIR_INLINE Ints shortened(Ints entry) { return entry & ~kNumber; }

  // Where many are equally far, as in a lattice: offers the candidates again in the order of their positions, so that
  // minima and maxima alone order ties. False if a distance differs from the shortened one, or if there are too many.
  bool offer_in_order(const IndexView& index, const Queries& queries, int k) {
    const Floats bound = smaller(as_floats(entry_[k - 1] | kNumber), queries.limit);
    PositionOrder order;
    for (int i = 0; i < candidates_; ++i) {
      const point::Vec3<float> there = position_of(index, Index(position_[i]));
      const Floats distance = point::squared_length(spread(there.x, there.y, there.z) - queries.position);
      const Mask hit = (distance <= bound) & (queries.at != broadcast(position_[i]));
      if (!any(hit)) continue;
      if (any(hit & ((as_ints(distance) & kNumber) != broadcast(0))) || order.is_full()) return false;
      order.append(there, position_[i]);
    }
    int positions[kNumber + 1];
    const int count = order.sort(positions);
    clear();
    for (int i = 0; i < count; i += kBatch)
      offer<true>(index, queries, bound, positions + i, count - i < kBatch ? count - i : kBatch);
    return true;
  }

  POINTFAIR_INLINE void insert(Ints entry) {
    for (int s = kSlots - 1; s > 0; --s) entry_[s] = larger(entry_[s - 1], smaller(entry_[s], entry));
    entry_[0] = smaller(entry_[0], entry);
  }

  // From 32 slots on cheaper than one insertion after the other. A sorted list and the reverse of a sorted round,
  // element by element, leave a bitonic sequence.
  static POINTFAIR_INLINE void merge(Ints* entries, Ints* round) {
    sort_run<0, kRound>(round);
    for (int i = 0; i < kRound; ++i) {
      Ints& kept = entries[K - kRound + i];
      const Ints candidate = round[kRound - 1 - i], evicted = larger(kept, candidate);
      kept = smaller(kept, candidate);
      entries[K + 1] = smaller(entries[K + 1], larger(entries[K], evicted));
      entries[K] = smaller(entries[K], evicted);
    }
    sort_bitonic<K>(entries);
  }

  // Moves a lane's entry s before those of the same shortened distance that it precedes.
  void put_in_order(const IndexView& index, const Queries& queries, int lane, int s) {
    const point::Vec3<float> here = {queries.position.x.v[lane], queries.position.y.v[lane],
                                     queries.position.z.v[lane]};
    const int entry = entry_[s].v[lane];
    const point::Vec3<float> own = position_of(index, Index(position_[entry & kNumber]));
    const float distance = point::squared_length(own - here);
    for (; s > 0; --s) {
      const int before = entry_[s - 1].v[lane];
      if ((before & ~kNumber) != (entry & ~kNumber)) break;
      const point::Vec3<float> there = position_of(index, Index(position_[before & kNumber]));
      const float its_distance = point::squared_length(there - here);
      if (its_distance < distance || (its_distance == distance && !point::lies_before(own, there))) break;
      entry_[s].v[lane] = before;
    }
    entry_[s].v[lane] = entry;
  }

  int k_;  // entries that are asked for, at most K
  Ints entry_[kSlots];
  int position_[kNumber + 1];  // of each candidate, by its number
  int candidates_;
};

// Any k, in the order of point::lies_before where distances are equal.
class ExactLists {
 public:
  static constexpr bool kOrdersTies = true, kTakesEquals = true;
  static constexpr int kBatch = 1;  // every candidate excludes others
  static constexpr int kMaxBatch = kBatch + kLeafSize;
  static constexpr int kCapacity = 1024;

  explicit ExactLists(int k) : k_(k) {}
  void clear() {
    for (int s = 0; s < k_; ++s) {
      squared_[s] = broadcast(kInfinity);
      position_[s] = broadcast(int(point::kNoNeighbor));
    }
  }
  Floats last() const { return squared_[k_ - 1]; }
  Ints at(int s) const { return position_[s]; }

  template <bool kOwn>
  void offer(const IndexView& index, const Queries& queries, Floats bound, const int* positions, int count) {
    for (int i = 0; i < count; ++i) {
      const Index at = Index(positions[i]);
      const point::Vec3<float> there = position_of(index, at);
      const Floats distance = point::squared_length(spread(there.x, there.y, there.z) - queries.position);
      Mask hit = distance <= bound;
      if constexpr (kOwn) hit = hit & (queries.at != broadcast(int(at)));
      insert(index, hit, distance, there, at);
    }
  }
  // Whether points at exactly `distance`, none of which lies before `corner`, may join a list whose bound is that
  // distance.
  bool is_open_at(const IndexView& index, float distance, point::Vec3<float> corner, Floats bound) const {
    const Mask bounded = bound == broadcast(distance), full = bounded & (last() == broadcast(distance));
    return any(bounded & ~full) || any(lies_before(index, full, corner, k_ - 1));
  }

 private:
  void insert(const IndexView& index, Mask hit, Floats distance, point::Vec3<float> there, Index candidate) {
    const Mask joins = hit & precedes(index, hit, distance, there, k_ - 1);
    Mask before = joins;
    for (int s = k_ - 1; any(before); --s) {
      const int p = s > 0 ? s - 1 : 0;
      const Mask before_previous = s > 0 ? joins & precedes(index, before, distance, there, p) : Mask{};
      squared_[s] = select(before, select(before_previous, squared_[p], distance), squared_[s]);
      position_[s] = select(before, select(before_previous, position_[p], broadcast(int(candidate))), position_[s]);
      before = before_previous;
    }
  }

  // In which lanes a candidate precedes entry s; where they are equally far, only in `asked` ones.
  POINTFAIR_INLINE Mask precedes(const IndexView& index, Mask asked, Floats distance, point::Vec3<float> there,
                                 int s) const {
    const Mask nearer = distance < squared_[s], tied = (distance == squared_[s]) & asked;
    return any(tied) ? nearer | lies_before(index, tied, there, s) : nearer;
  }
  // In which of these lanes, whose entry s exists, a point lies before it. They are few.
  POINTFAIR_INLINE Mask lies_before(const IndexView& index, Mask lanes, point::Vec3<float> there, int s) const {
    unsigned result = 0;
    for (unsigned left = bits(lanes); left != 0; left &= left - 1) {
      const int lane = __builtin_ctz(left);
      result |= unsigned(point::lies_before(there, position_of(index, Index(position_[s].v[lane])))) << lane;
    }
    return mask_of(result);
  }

  int k_;
  Floats squared_[kCapacity];
  Ints position_[kCapacity];
};

}  // namespace pointfair::cpu::POINTFAIR_ISA
