// SPDX-License-Identifier: Apache-2.0
// The k nearest other points of a group of neighbouring points at once, one query a lane. The group walks the tree
// together: a node is entered if its box is nearer to the group's box than the worst of the lanes' k-th distances, and
// each candidate is offered to all lanes. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/lists.h"
#include "cpu/pack.h"

namespace pointfair::cpu::POINTFAIR_ISA {

POINTFAIR_INLINE Queries make_queries(const IndexView& index, Index first, Mask active, Floats limit) {
  Queries q;
  q.position = {load(index.x + first), load(index.y + first), load(index.z + first)};
  q.at = Ints{lane_numbers().v + int(first)};
  q.limit = select(active, limit, broadcast(-1.0f));
  const Floats inf = broadcast(kInfinity);
  q.min = spread(smallest(select(active, q.position.x, inf)), smallest(select(active, q.position.y, inf)),
                 smallest(select(active, q.position.z, inf)));
  q.max = spread(largest(select(active, q.position.x, -inf)), largest(select(active, q.position.y, -inf)),
                 largest(select(active, q.position.z, -inf)));
  return q;
}

// One walk of a group over the tree. `Lists` collects. `kAnywhere`: a query's own place may lie in any leaf.
template <class Lists, bool kAnywhere = false>
class GroupSearch {
 public:
  POINTFAIR_INLINE GroupSearch(const IndexView& index, const Queries& queries, Lists& lists, int leaf_budget)
      : index_(index), q_(queries), lists_(lists), budget_(leaf_budget) {
    lists_.clear();
    update_bound();
  }

  // From the leaf outwards: its own points, the leaves beside it on the curve, then the siblings of each ancestor.
  // Returns false if it gave up: the budget of leaves ran out, or ties decide and the lists do not order them.
  bool run(Index own_leaf, Index leaves_beside) {
    collect_leaf(own_leaf);
    offer_waiting<true>();
    first_done_ = own_leaf > leaves_beside ? own_leaf - leaves_beside : 0;
    last_done_ = own_leaf + leaves_beside < index_.leaves ? own_leaf + leaves_beside : index_.leaves - 1;
    for (Index leaf = first_done_; leaf <= last_done_; ++leaf)
      if (leaf != own_leaf) visit_leaf(leaf);
    offer_waiting<false>();
    if constexpr (!Lists::kOrdersTies)  // more than k identical points: only their order is left to find
      if (lists_.all_identical()) return false;
    Index node = own_leaf;
    for (int level = 0; level < index_.levels; ++level) {
      if (!visit_children(level, node / kLeafSize, level == 0 ? kLeafSize : node % kLeafSize)) return false;
      node /= kLeafSize;
    }
    offer_waiting<false>();
    return true;
  }

 private:
  POINTFAIR_INLINE void update_bound() {
    bound_ = smaller(lists_.last(), q_.limit);
    farthest_ = largest(bound_);
  }

  // Whether points behind a gap may be candidates.
  static POINTFAIR_INLINE Mask are_near(Floats gap, Floats farthest) {
    if constexpr (Lists::kTakesEquals) return gap <= farthest;
    return gap < farthest;
  }

  // Bit c is set if child c of the group may hold a neighbour; gaps receives the squared distance to each child.
  POINTFAIR_INLINE unsigned near_children(const BoxGroup& group, float* gaps) const {
    unsigned result = 0;
    const Floats farthest = broadcast(farthest_);
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const point::Vec3<Floats> min = {load(group.min_x + c), load(group.min_y + c), load(group.min_z + c)};
      const point::Vec3<Floats> max = {load(group.max_x + c), load(group.max_y + c), load(group.max_z + c)};
      const Floats gap = point::squared_gap(min, max, q_.min, q_.max);
      store(gaps + c, gap);
      result |= bits(are_near(gap, farthest)) << c;
    }
    return result;
  }

  // Whether a child that was near still is, after its siblings' visits.
  POINTFAIR_INLINE bool still_near(const BoxGroup& group, const float* gaps, int c) const {
    if constexpr (Lists::kOrdersTies)  // of many equals, the first ones visited exclude the rest
      if (gaps[c] == farthest_) return lists_.is_open_at(index_, farthest_, low_corner(group, c), bound_);
    return Lists::kTakesEquals ? gaps[c] <= farthest_ : gaps[c] < farthest_;
  }

  bool visit_children(int level, Index group_number, Index skipped) {
    const BoxGroup& group = index_.level[level][group_number];
    float gaps[kLeafSize];
    unsigned children = near_children(group, gaps) & ~(1u << skipped);
    for (; children != 0; children &= children - 1) {
      const int c = __builtin_ctz(children);
      const Index child = group_number * kLeafSize + Index(c);
      if (!still_near(group, gaps, c)) continue;
      if (level > 0) {
        if (!visit_children(level - 1, child, kLeafSize)) return false;
      } else if (child < first_done_ || child > last_done_) {
        if (--budget_ < 0) return false;
        visit_leaf(child);
      }
    }
    return true;
  }

  POINTFAIR_INLINE void visit_leaf(Index leaf) {
    collect_leaf(leaf);
    if (waiting_count_ >= Lists::kBatch) offer_waiting<false>();
  }

  POINTFAIR_INLINE void collect_leaf(Index leaf) {
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const Index first = leaf * kLeafSize + Index(c);
      const point::Vec3<Floats> p = {load(index_.x + first), load(index_.y + first), load(index_.z + first)};
      const Mask near = are_near(point::squared_gap(p, p, q_.min, q_.max), broadcast(farthest_));
      waiting_count_ += append(waiting_ + waiting_count_, int(first), near);
    }
  }

  template <bool kOwn>
  POINTFAIR_INLINE void offer_waiting() {
    lists_.template offer<kOwn || kAnywhere>(index_, q_, bound_, waiting_, waiting_count_);
    waiting_count_ = 0;
    update_bound();
  }

  const IndexView& index_;
  const Queries& q_;
  Lists& lists_;
  Floats bound_;        // per lane: what a candidate must not exceed
  float farthest_ = 0;  // the largest of them when last measured
  int waiting_count_ = 0;
  int waiting_[Lists::kMaxBatch + kLanes];  // sorted positions of candidates still to be offered
  Index first_done_ = 0, last_done_ = 0;
  int budget_;
};

// A group whose box is wide against its lanes' reach (a stray point among others, a jump of the curve) would visit far
// too much together; past this many leaves it is split, and a single lane goes to the search that visits the nearest
// boxes first.
POINTFAIR_INLINE int leaf_budget(int k) { return 128 + 2 * k; }
POINTFAIR_INLINE Index leaves_beside(int k) { return Index(k + kLeafSize - 1) / kLeafSize; }

// The first k of each active lane.
template <class Lists>
POINTFAIR_INLINE void copy_lists(const Lists& lists, int k, Mask active, Index* out) {
  for (int s = 0; s < k; ++s) {
    const Ints found = lists.at(s);
    if (!any(~active)) {
      store(out + s * kLeafSize, found);
      continue;
    }
    for (unsigned lanes = bits(active); lanes != 0; lanes &= lanes - 1) {
      const int lane = __builtin_ctz(lanes);
      out[s * kLeafSize + lane] = Index(found.v[lane]);
    }
  }
}

POINTFAIR_INLINE Mask lanes_between(int first, int last) {
  return ~(lane_numbers() < broadcast(first)) & (lane_numbers() < broadcast(last));
}

POINTFAIR_INLINE void search_alone(const IndexView& index, Index start, int lane, int k, Floats limit, Index* out) {
  find_alone(index, start + Index(lane), k, limit.v[lane], out + lane);
}

// One walk with exact lists, which take up to 128 KiB of stack: only while this runs, not while halves are searched.
// Returns false if it gave up; then k candidates lie within `known`.
[[gnu::noinline]] static bool walk_exact(const IndexView& index, Index start, Mask active, int k, Floats limit,
                                         Index* out, Floats* known) {
  ExactLists lists(k);
  const Queries queries = make_queries(index, start, active, limit);
  GroupSearch<ExactLists> search(index, queries, lists, leaf_budget(k));
  const bool is_whole = search.run(start / kLeafSize, leaves_beside(k));
  if (is_whole) copy_lists(lists, k, active, out);
  *known = smaller(lists.last(), limit);
  return is_whole;
}

// Lanes [first_lane, last_lane) of the pack that starts at sorted position `start`.
inline void search_exact(const IndexView& index, Index start, int first_lane, int last_lane, int k, Floats limit,
                         Index* out) {
  const Mask active = lanes_between(first_lane, last_lane) & (lane_numbers() < broadcast(int(index.points - start)));
  if (!any(active)) return;
  if (last_lane - first_lane == 1) return search_alone(index, start, first_lane, k, limit, out);
  Floats known;
  if (walk_exact(index, start, active, k, limit, out, &known)) return;
  const int middle = (first_lane + last_lane) / 2;
  search_exact(index, start, first_lane, middle, k, known, out);
  search_exact(index, start, middle, last_lane, k, known, out);
}

// The k points behind each of a pack, or before it.
struct Consecutive {
  Index start;
  int step;
  POINTFAIR_INLINE Ints at(int s) const { return {lane_numbers().v + (int(start) + step * (s + 1))}; }
};

// Whether `count` points from `first` on are at one place, and none at another so near that squared distances to it
// could round to zero: its coordinates are not that small.
inline bool are_in_one_place(const IndexView& index, Index first, Index count) {
  constexpr float kSmall = 1e-15f;  // differences of larger numbers are above 5e-23, whose square is not zero
  const auto is_one = [&](const float* axis) {
    const float here = axis[first];
    for (Index i = 1; i < count; ++i)
      if (axis[first + i] != here) return false;
    return here > kSmall || here < -kSmall;
  };
  return first + count <= index.points && is_one(index.x) && is_one(index.y) && is_one(index.z);
}

// Of many identical points any are the nearest, so those that follow on the curve, or those before. Returns false where
// there are not enough.
inline bool list_identical(const IndexView& index, Index start, int k, Mask active, Index* out) {
  const Index reach = Index(k), count = Index(kLanes + k);
  if (are_in_one_place(index, start, count)) {
    copy_lists(Consecutive{start, 1}, k, active, out);
  } else if (start >= reach && are_in_one_place(index, start - reach, count)) {
    copy_lists(Consecutive{start, -1}, k, active, out);
  } else {
    return false;
  }
  return true;
}

template <int K>
void search_pack(const IndexView& index, Index start, int first_lane, int last_lane, int k, Floats limit, Index* out) {
  const Mask active = lanes_between(first_lane, last_lane) & (lane_numbers() < broadcast(int(index.points - start)));
  if (!any(active)) return;
  if (last_lane - first_lane == 1) return search_alone(index, start, first_lane, k, limit, out);
  FastLists<K> lists(k);
  const Queries queries = make_queries(index, start, active, limit);
  GroupSearch<FastLists<K>> search(index, queries, lists, leaf_budget(k));
  const bool whole = search.run(start / kLeafSize, leaves_beside(K)) && !lists.overflown();
  if (whole && lists.finish(index, queries, k, active)) return copy_lists(lists, k, active, out);
  const Floats known = smaller(lists.last(), limit);
  if (lists.all_identical() && list_identical(index, start, k, active, out)) return;
  if (whole || lists.all_identical()) return search_exact(index, start, first_lane, last_lane, k, known, out);
  const int middle = (first_lane + last_lane) / 2;
  search_pack<K>(index, start, first_lane, middle, k, known, out);
  search_pack<K>(index, start, middle, last_lane, k, known, out);
}

inline void search_lanes(const IndexView& index, Index start, int first_lane, int last_lane, int k, float squared_limit,
                         Index* out) {
  const Floats limit = broadcast(squared_limit);
  if (k <= 8) return search_pack<8>(index, start, first_lane, last_lane, k, limit, out);
  if (k <= 16) return search_pack<16>(index, start, first_lane, last_lane, k, limit, out);
  if (k <= 32) return search_pack<32>(index, start, first_lane, last_lane, k, limit, out);
  if (k <= 64) return search_pack<64>(index, start, first_lane, last_lane, k, limit, out);
  search_exact(index, start, first_lane, last_lane, k, limit, out);
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
