// SPDX-License-Identifier: Apache-2.0
// The k <= 64 nearest other points of all points of a leaf, exact to the last tie: for leaves where the keys of
// group_search.cuh cannot tell candidates apart, as in quantised clouds, lattices, and many points in one place; and
// for the points of another tree.
#pragma once

#include "cuda/search/query_boxes.cuh"

namespace pointfair::cuda {

template <int kList>
class ExactGroupSearch {
 public:
  __device__ __forceinline__ ExactGroupSearch(const Tree& tree, Index leaf)
      : ExactGroupSearch(tree, leaf, tree.points[leaf * kLeafSize + lane_number()], leaf * kLeafSize + lane_number()) {}
  // Of a query each lane, which stands at `at` in the tree, kNoNeighbor if it is not there; `leaf`: one near them.
  __device__ __forceinline__ ExactGroupSearch(const Tree& tree, Index leaf, float4 query, Index at)
      : tree_(tree),
        leaf_(leaf),
        at_(at),
        mine_(query),
        active_(is_present(query)),
        boxes_(position_of(query), active_) {}

  __device__ __forceinline__ void run(int k, float squared_limit) {
#pragma unroll
    for (int i = 0; i < kList; ++i) {  // the first places hold what nothing precedes where k is smaller than the list
      distance_[i] = i < kList - k ? -1.0f : kInfinite;
      position_[i] = point::kNoNeighbor;
    }
    limit_ = squared_limit;
    LeafOrder order(tree_, leaf_, kList <= 16 ? 1 : 2);
    const auto near = [&](const BoxGroup& group) { return is_near(box_of_lane(group)); };
    Index leaf = leaf_;
    do {
      visit(leaf);
      leaf = order.next(near);
    } while (leaf != point::kNoNeighbor);
  }

  __device__ __forceinline__ void write(int k, Index* list) const {
    write(k, list, [](Index at) { return at; });
  }
  // What `name_of` makes of the positions.
  template <class NameOf>
  __device__ __forceinline__ void write(int k, Index* list, const NameOf& name_of) const {
    const int first = kList - k;
#pragma unroll
    for (int i = 0; i < kList; ++i)
      if (i >= first && active_) list[(i - first) * kWarp + lane_number()] = name_of(position_[i]);
  }

 private:
  // At exactly the reach only points that lie before the last in some list still matter. Boxes that do not exist are
  // infinitely far.
  __device__ __forceinline__ bool is_within(float gap, float reach, Vec corner) const {
    return gap < reach || (gap == reach && gap < kInfinite && point::lies_before(corner, last_place_));
  }
  __device__ __forceinline__ bool is_near(const Box& box) const {
    bool near = is_within(squared_gap(box, boxes_.box[0]), boxes_.reach[0], box.min);
    if (boxes_.split) near = near || is_within(squared_gap(box, boxes_.box[1]), boxes_.reach[1], box.min);
    return near;
  }

  __device__ __forceinline__ void visit(Index leaf) {
    const Index at = leaf * kLeafSize + lane_number();
    const Vec p = position_of(tree_.points[at]);
    const bool near = leaf == leaf_ || is_near({p, p});
    for (unsigned all = __ballot_sync(kAllLanes, near); all != 0; all &= all - 1) {
      const int lane = __ffs(static_cast<int>(all)) - 1;
      const Vec there = {__shfl_sync(kAllLanes, p.x, lane), __shfl_sync(kAllLanes, p.y, lane),
                         __shfl_sync(kAllLanes, p.z, lane)};
      offer(there, leaf * kLeafSize + Index(lane));
    }
    update_reach();
  }

  __device__ __forceinline__ void offer(Vec there, Index at) {
    const float distance = point::squared_length(there - position_of(mine_));
    if (!active_ || at == at_ || !(distance <= limit_) || !(distance < kInfinite)) return;
    if (distance > distance_[kList - 1] || (distance == distance_[kList - 1] && !point::lies_before(there, last())))
      return;
    bool before = true, tied = false;
#pragma unroll
    for (int i = kList - 1; i > 0; --i) {
      const bool before_previous = distance < distance_[i - 1];
      tied = tied || distance == distance_[i - 1];
      distance_[i] = before_previous ? distance_[i - 1] : before ? distance : distance_[i];
      position_[i] = before_previous ? position_[i - 1] : before ? at : position_[i];
      before = before_previous;
    }
    distance_[0] = before ? distance : distance_[0];
    position_[0] = before ? at : position_[0];
    if (tied) put_in_order(there, distance, at);
  }

  // The point at `at` stands behind those equally far; moves it before those that it lies before.
  __device__ __forceinline__ void put_in_order(Vec there, float distance, Index at) {
#pragma unroll
    for (int i = kList - 1; i > 0; --i) {
      if (position_[i] != at || distance_[i - 1] != distance) continue;
      if (!point::lies_before(there, position_of(tree_.points[position_[i - 1]]))) continue;
      position_[i] = position_[i - 1];
      position_[i - 1] = at;
    }
  }

  // The position of the last in the list, beyond all others if the list is not full.
  __device__ __forceinline__ Vec last() {
    if (position_[kList - 1] != last_) {
      last_ = position_[kList - 1];
      place_of_last_ = position_of(tree_.points[last_]);
    }
    return place_of_last_;
  }

  __device__ __forceinline__ void update_reach() {
    const float reach = fminf(distance_[kList - 1], limit_);
    boxes_.set_reach(
        active_ ? __float_as_uint(reach) : 0u, [](unsigned bits, float) { return __uint_as_float(bits); }, 0.0f);
    const bool at_end = active_ && reach == (boxes_.in_second ? boxes_.reach[1] : boxes_.reach[0]);
    last_place_ = farthest_place(last(), at_end);
  }
  // Of some lanes the position that none of the others' lies behind.
  __device__ __forceinline__ static Vec farthest_place(Vec place, bool counts) {
    const unsigned x = counts ? ordered_number(place.x) : 0u, most_x = warp_max(x);
    const unsigned y = counts && x == most_x ? ordered_number(place.y) : 0u, most_y = warp_max(y);
    const unsigned z = counts && x == most_x && y == most_y ? ordered_number(place.z) : 0u, most_z = warp_max(z);
    return {unordered(most_x), unordered(most_y), unordered(most_z)};
  }

  static constexpr float kInfinite = __builtin_inff();

  const Tree& tree_;
  Index leaf_, at_;
  float4 mine_;
  bool active_;
  QueryBoxes boxes_;
  float limit_ = 0;
  Vec last_place_{};  // of those at the end of the lists that reach farthest, the one behind all others
  Index last_ = point::kNoNeighbor;
  Vec place_of_last_ = {kInfinite, kInfinite, kInfinite};
  float distance_[kList];
  Index position_[kList];
};

}  // namespace pointfair::cuda
