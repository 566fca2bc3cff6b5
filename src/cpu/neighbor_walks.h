// SPDX-License-Identifier: Apache-2.0
// Walks over the neighbours of a pack of points: along lists or, without lists, over everything within a radius in
// sorted order. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/notes.h"
#include "cpu/pack.h"
#include "cpu/search.h"
#include "point/neighborhoods.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// Handles of neighbours, by sorted position: another one in each lane, the same in all, or the pack's own points.
struct Gathered {
  Ints at;
  POINTFAIR_INLINE Floats of(const float* values) const { return gather(values, at); }
};
struct Shared {
  Index at;
  POINTFAIR_INLINE Floats of(const float* values) const { return broadcast(values[at]); }
};
struct Own {
  Index start;
  POINTFAIR_INLINE Floats of(const float* values) const { return load(values + start); }
};

// What belongs to a point, for those handles.
struct Vectors {
  VectorsView view;
  template <class There>
  POINTFAIR_INLINE point::Vec3<Floats> at(There there) const {
    return {there.of(view.x), there.of(view.y), there.of(view.z)};
  }
};
struct Scalars {
  const float* values;
  template <class There>
  POINTFAIR_INLINE Floats of(There there) const {
    return there.of(values);
  }
};
struct Areas {
  AreaView area;
  template <class There>
  POINTFAIR_INLINE Floats of(There there) const {
    if (area.power == 0) return broadcast(1.0f);
    const Floats length = there.of(area.mean_distance);
    return area.power == 1 ? length : length * length;
  }
};

// Lists fill from the front, so the walk ends at the first slot that is empty in every lane.
class ListWalk {
 public:
  using Number = Floats;
  using Kernel = point::Gaussian;
  static constexpr bool kListed = true;
  using Count = Floats;

  // list[slot * 16] is the first lane's entry
  POINTFAIR_INLINE ListWalk(const IndexView& index, Index start, const Index* list, int k)
      : index_(index), start_(start), list_(list), k_(k) {}

  template <class Load, class Visit>
  POINTFAIR_INLINE void operator()(Load load_there, Visit visit) const {
    const point::Vec3<Floats> here = {load(index_.x + start_), load(index_.y + start_), load(index_.z + start_)};
    const Ints empty = broadcast(int(point::kNoNeighbor));
    for (int slot = 0; slot < k_; ++slot) {
      const Ints listed = load(list_ + slot * kLeafSize);
      const Mask inside = listed != empty;
      if (!any(inside)) return;
      const Gathered at{select(inside, listed, broadcast(0))};
      const point::Vec3<Floats> there = {at.of(index_.x), at.of(index_.y), at.of(index_.z)};
      visit(there - here, load_there(at), inside);
    }
  }
  POINTFAIR_INLINE Floats squared_radius() const { return broadcast(1.0f); }  // lists have no width of their own
  POINTFAIR_INLINE Floats squared_core() const { return broadcast(__builtin_inff()); }
  POINTFAIR_INLINE Floats squared_horizon() const { return broadcast(0.0f); }
  POINTFAIR_INLINE static bool any(Mask mask) { return cpu::POINTFAIR_ISA::any(mask); }

 private:
  const IndexView& index_;
  Index start_;
  const Index* list_;
  int k_;
};

POINTFAIR_INLINE Floats value_or_one(const float* values, Index start) {
  return values == nullptr ? broadcast(1.0f) : load(values + start);
}

// Those that edges reach within the radius of each point. Thinned balls do not hold all points that do, so no horizon
// is known.
class BallWalk {
 public:
  using Number = Floats;
  using Count = Floats;
  using Kernel = point::CompactGaussian;
  static constexpr bool kListed = false;

  POINTFAIR_INLINE BallWalk(const IndexView& index, Index start, const LeafBalls& balls, const point::Radii& radii)
      : index_(index),
        start_(start),
        at_(balls.at),
        lanes_(radii.squared_growth == nullptr ? balls.in_radius : balls.lanes),
        count_(balls.count),
        own_bits_(Ints{1 << (lane_numbers().v + int(start % kLeafSize))}),
        limit_(radii.squared_growth == nullptr
                   ? load(radii.squared_radius + start)
                   : load(radii.squared_radius + start) * load(radii.squared_growth + start)) {}

  template <class Load, class Visit>
  POINTFAIR_INLINE void operator()(Load load_there, Visit visit) const {
    const point::Vec3<Floats> here = {load(index_.x + start_), load(index_.y + start_), load(index_.z + start_)};
    const unsigned pack = ((1u << kLanes) - 1) << (start_ % kLeafSize);
    for (int i = 0; i < count_; ++i) {
      const unsigned lanes = lanes_[i];
      if ((lanes & pack) == 0) continue;
      const Index at = at_[i];
      const point::Vec3<Floats> offset = spread(index_.x[at], index_.y[at], index_.z[at]) - here;
      const Mask reached = Ints{broadcast(int(lanes)).v & own_bits_.v} == own_bits_;
      visit(offset, load_there(Shared{at}), reached & (point::squared_length(offset) <= limit_));
    }
  }
  POINTFAIR_INLINE Floats squared_radius() const { return limit_; }
  POINTFAIR_INLINE Floats squared_core() const { return point::squared_core(limit_); }
  POINTFAIR_INLINE Floats squared_horizon() const { return broadcast(0.0f); }
  POINTFAIR_INLINE static bool any(Mask mask) { return cpu::POINTFAIR_ISA::any(mask); }

 private:
  const IndexView& index_;
  Index start_;
  const Index* at_;
  const std::uint16_t* lanes_;
  int count_;
  Ints own_bits_;
  Floats limit_;
};

// For a function that writes to members which its callers, inlined elsewhere, read: GCC 12, which sees through
// noinline, kept what such a caller had read before the call (with SSE2 and AVX2; -fno-ipa-modref or
// -fno-strict-aliasing cure it).
#if __has_attribute(noipa)
#define POINTFAIR_OPAQUE __attribute__((noinline, noipa))
#else
#define POINTFAIR_OPAQUE __attribute__((noinline))
#endif

// Walks the tree from the root in sorted order, so that sums have one order whatever the instruction set. The
// neighbours are first found and then visited, in a loop that keeps the sums of `visit` in registers and has no branch
// to guess.
class RadiusWalk {
 public:
  using Number = Floats;
  using Kernel = point::CompactGaussian;
  static constexpr bool kListed = false;
  using Count = Floats;

  POINTFAIR_INLINE RadiusWalk(const IndexView& index, Index start, const point::Radii& radii) : index_(index) {
    const Mask active = lane_numbers() < broadcast(int(index.points - start));
    const Floats own = load(radii.squared_radius + start);
    const Floats grown = radii.squared_growth == nullptr ? own : own * load(radii.squared_growth + start);
    queries_ = make_queries(index, start, active, grown);
    farthest_ = largest(queries_.limit);
    share_ = broadcast(1.0f);
    if (radii.min_neighbors > 0)
      share_ = select(active, point::kept_share(radii, value_or_one(radii.squared_level, start), own, queries_.limit),
                      broadcast(0.0f));
    largest_share_ = largest(share_);
    is_thinned_ = smallest(select(active, share_, broadcast(1.0f))) < 1.0f;
  }

  template <class Load, class Visit>
  POINTFAIR_INLINE void operator()(Load load_there, Visit visit) const {
    bool begins = true;
    do {
      if (!found_.has_all) search(begins);
      begins = false;
      for (int i = 0; i < found_.count; ++i) {
        const Index at = found_.at[i];
        const point::Vec3<Floats> there = spread(index_.x[at], index_.y[at], index_.z[at]);
        visit(there - queries_.position, load_there(Shared{at}), found_.inside[i]);
      }
    } while (!place_.is_end());
  }
  POINTFAIR_INLINE Floats squared_radius() const { return queries_.limit; }
  POINTFAIR_INLINE Floats squared_core() const { return point::squared_core(queries_.limit); }
  POINTFAIR_INLINE Floats squared_horizon() const {
    return select(share_ < broadcast(1.0f), broadcast(0.0f), queries_.limit);
  }
  POINTFAIR_INLINE static bool any(Mask mask) { return cpu::POINTFAIR_ISA::any(mask); }

  // After a walk.
  void note(Notes& notes) const { Note::write(notes, found_.at, found_.has_all && !is_thinned_ ? found_.count : 0); }

 private:
  // Some of the neighbours of the pack's points, in sorted order: position and lanes.
  struct Found {
    static constexpr int kRoom = Note::kMostPoints;
    Index at[kRoom];
    Mask inside[kRoom];
    int count = 0;
    bool has_all = false;  // a further walk visits them again
  };
  static constexpr int kWaiting = 128;  // points that may be neighbours, at most
  // What of the tree is still to be seen: on each level from the lowest, a group and its children that are near.
  struct Place {
    Index group[kMaxLevels];
    unsigned near[kMaxLevels];
    int level, levels;
    bool is_end() const { return level == levels; }
  };

  // Fills `found_` with the first neighbours, or with the next.
  POINTFAIR_OPAQUE void search(bool begins) const {
    if (begins) {
      place_.levels = index_.levels;
      place_.level = index_.levels - 1;
      enter(queries_, broadcast(farthest_), place_.level, 0);
    }
    found_.count = 0;
    while (!place_.is_end() && found_.count <= Found::kRoom - kWaiting) {
      int waiting[kWaiting + kLanes];
      const int count = collect(waiting);
      is_thinned_ ? keep_inside<true>(waiting, count) : keep_inside<false>(waiting, count);
    }
    found_.has_all = begins && place_.is_end();
  }

  // The loops below read members that do not change from copies: to clang, every store of packs may change a member.

  // Points that are near the pack, by sorted position, until no further leaf may fit; returns how many.
  POINTFAIR_INLINE int collect(int* waiting) const {
    const Queries queries = queries_;
    const Floats farthest = broadcast(farthest_);
    int count = 0, level = place_.level;
    while (level < place_.levels && count <= kWaiting - kLeafSize) {
      unsigned& near = place_.near[level];
      if (near == 0) {
        ++level;
        continue;
      }
      const Index child = place_.group[level] * kLeafSize + Index(__builtin_ctz(near));
      near &= near - 1;
      if (level > 0) {
        enter(queries, farthest, --level, child);
      } else {
        count += collect_leaf(queries, farthest, child, waiting + count);
      }
    }
    place_.level = level;
    return count;
  }

  POINTFAIR_INLINE void enter(const Queries& queries, Floats farthest, int level, Index group_number) const {
    const BoxGroup& group = index_.level[level][group_number];
    unsigned near = 0;
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const point::Vec3<Floats> min = {load(group.min_x + c), load(group.min_y + c), load(group.min_z + c)};
      const point::Vec3<Floats> max = {load(group.max_x + c), load(group.max_y + c), load(group.max_z + c)};
      near |= bits(point::squared_gap(min, max, queries.min, queries.max) <= farthest) << c;
    }
    place_.group[level] = group_number;
    place_.near[level] = near;
  }

  POINTFAIR_INLINE int collect_leaf(const Queries& queries, Floats farthest, Index leaf, int* waiting) const {
    int count = 0;
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const Index first = leaf * kLeafSize + Index(c);
      const point::Vec3<Floats> p = {load(index_.x + first), load(index_.y + first), load(index_.z + first)};
      Mask near = point::squared_gap(p, p, queries.min, queries.max) <= farthest;
      if (is_thinned_) near = near & (load(index_.share + first) < broadcast(largest_share_));
      count += append(waiting + count, int(first), near);
    }
    return count;
  }

  // Those of them that are neighbours of a point of the pack.
  template <bool kThinned>
  POINTFAIR_INLINE void keep_inside(const int* waiting, int waiting_count) const {
    const Queries queries = queries_;
    const Floats share = share_;
    const VectorsView points = {index_.x, index_.y, index_.z};
    int count = found_.count;
    for (int i = 0; i < waiting_count; ++i) {
      const int at = waiting[i];
      const point::Vec3<Floats> offset = spread(points.x[at], points.y[at], points.z[at]) - queries.position;
      Mask inside = (point::squared_length(offset) <= queries.limit) & ~(queries.at == broadcast(at));
      if constexpr (kThinned) inside = inside & (broadcast(index_.share[at]) < share);
      found_.at[count] = Index(at);
      found_.inside[count] = inside;
      count += any(inside);
    }
    found_.count = count;
  }

  const IndexView& index_;
  Queries queries_;
  float farthest_;  // the largest squared radius of the lanes
  Floats share_;    // of the neighbours that count
  float largest_share_;
  bool is_thinned_;
  mutable Found found_;
  mutable Place place_;
};

// What RadiusWalk met, in the same order, so that sums are the same. Lanes that a neighbour belongs to are found anew:
// a visit needs the distance anyway.
class NotedWalk {
 public:
  using Number = Floats;
  using Kernel = point::CompactGaussian;
  static constexpr bool kListed = false;
  using Count = Floats;

  POINTFAIR_INLINE NotedWalk(const IndexView& index, Index start, const point::Radii& radii, Note note)
      : index_(index), start_(start), position_{load(index.x + start), load(index.y + start), load(index.z + start)} {
    const Mask active = lane_numbers() < broadcast(int(index.points - start));
    limit_ = select(active, load(radii.squared_radius + start), broadcast(-1.0f));
    own_ = Ints{lane_numbers().v + int(start)};
    count_ = note.unpack(at_);
  }

  template <class Load, class Visit>
  POINTFAIR_INLINE void operator()(Load load_there, Visit visit) const {
    for (int i = 0; i < count_; ++i) {
      const Index at = Index(at_[i]);
      const point::Vec3<Floats> offset = spread(index_.x[at], index_.y[at], index_.z[at]) - position_;
      Mask inside = point::squared_length(offset) <= limit_;
      if (at - start_ < Index(kLanes)) [[unlikely]]
        inside = inside & (own_ != broadcast(int(at)));
      visit(offset, load_there(Shared{at}), inside);
    }
  }
  POINTFAIR_INLINE Floats squared_radius() const { return limit_; }
  POINTFAIR_INLINE Floats squared_core() const { return point::squared_core(limit_); }
  POINTFAIR_INLINE Floats squared_horizon() const { return limit_; }
  POINTFAIR_INLINE static bool any(Mask mask) { return cpu::POINTFAIR_ISA::any(mask); }

 private:
  const IndexView& index_;
  Index start_;
  point::Vec3<Floats> position_;
  Floats limit_;
  Ints own_;
  int count_;
  int at_[Note::kMostPoints + kLanes];
};

// Calls body(start, neighbours) for each pack of the leaf.
template <class Body>
POINTFAIR_INLINE void for_packs(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods, Body body) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    if (neighborhoods.lists.balls != nullptr) {
      body(start, BallWalk(index, start, neighborhoods.lists.balls[leaf], neighborhoods.radii));
    } else if (neighborhoods.lists.k > 0) {
      const LeafLists lists = neighborhoods.lists.of_leaf(leaf);
      body(start, ListWalk(index, start, lists.list + part, lists.k));
    } else if (start < index.points) {
      body(start, RadiusWalk(index, start, neighborhoods.radii));
    }
  }
}

// Whether every point of the pack has the radius that it had for its normal.
POINTFAIR_INLINE bool is_not_grown(const IndexView& index, Index start, const point::Radii& radii) {
  if (radii.squared_growth == nullptr) return true;
  const Mask active = lane_numbers() < broadcast(int(index.points - start));
  return !any(active & ~(load(radii.squared_growth + start) == broadcast(1.0f)));
}

// The same, without a search where there are notes of the same radius.
template <class Body>
POINTFAIR_INLINE void for_noted_packs(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods,
                                      Notes& notes, Body body) {
  if (notes.next == nullptr) return for_packs(index, leaf, neighborhoods, body);
  for (Index start = leaf * kLeafSize; start < (leaf + 1) * kLeafSize && start < index.points; start += kLanes) {
    const Note note(notes);
    if (note.exists() && is_not_grown(index, start, neighborhoods.radii)) {
      body(start, NotedWalk(index, start, neighborhoods.radii, note));
    } else {
      body(start, RadiusWalk(index, start, neighborhoods.radii));
    }
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
