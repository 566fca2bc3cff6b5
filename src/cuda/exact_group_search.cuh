// SPDX-License-Identifier: Apache-2.0
// The k <= 32 nearest other points of all points of a leaf, exact to the last tie: for leaves where the keys of
// group_search.cuh cannot tell candidates apart, as in quantised clouds, lattices, and many points in one place.
#pragma once

#include "cuda/query_boxes.cuh"

namespace pointfair::cuda {

template <int kList>
class ExactGroupSearch {
 public:
  __device__ __forceinline__ ExactGroupSearch(const Tree& tree, Index leaf)
      : tree_(tree),
        leaf_(leaf),
        at_(leaf * kLeafSize + lane_number()),
        mine_(tree.points[at_]),
        active_(is_present(mine_)),
        boxes_(position_of(mine_), active_) {}

  __device__ __forceinline__ void run(int k, float squared_limit) {
#pragma unroll
    for (int i = 0; i < kList; ++i) {  // the first places hold what nothing precedes where k is smaller than the list
      distance_[i] = i < kList - k ? -1.0f : __int_as_float(0x7f800000);
      original_[i] = position_[i] = point::kNoNeighbor;
    }
    limit_ = squared_limit;
    LeafOrder order(tree_, leaf_, kList <= 16 ? 1 : 2);
    const auto near = [&](const BoxGroup& group) {
      return is_near(box_of_lane(group), group.least_original[lane_number()]);
    };
    Index leaf = leaf_;
    do {
      visit(leaf);
      leaf = order.next(near);
    } while (leaf != point::kNoNeighbor);
  }

  __device__ __forceinline__ void write(int k, Index* list) const {
    const int first = kList - k;
#pragma unroll
    for (int i = 0; i < kList; ++i)
      if (i >= first && active_) list[(i - first) * kWarp + lane_number()] = position_[i];
  }

 private:
  __device__ __forceinline__ bool precedes(float distance, Index original, int place) const {
    return distance < distance_[place] || (distance == distance_[place] && original < original_[place]);
  }

  // At exactly the reach only points of a lower original index than the last in some list still matter. Boxes that do
  // not exist are infinitely far.
  __device__ __forceinline__ bool is_within(float gap, float reach, Index least_original) const {
    return gap < reach || (gap == reach && least_original <= last_original_ && gap < __int_as_float(0x7f800000));
  }
  __device__ __forceinline__ bool is_near(const Box& box, Index least_original) const {
    bool near = is_within(squared_gap(box, boxes_.box[0]), boxes_.reach[0], least_original);
    if (boxes_.split) near = near || is_within(squared_gap(box, boxes_.box[1]), boxes_.reach[1], least_original);
    return near;
  }

  __device__ __forceinline__ void visit(Index leaf) {
    const Index at = leaf * kLeafSize + lane_number();
    const float4 p = tree_.points[at];
    const bool near = leaf == leaf_ || is_near({position_of(p), position_of(p)}, original_of(p));
    for (unsigned all = __ballot_sync(kAllLanes, near); all != 0; all &= all - 1) {
      const int lane = __ffs(static_cast<int>(all)) - 1;
      const Vec there = {__shfl_sync(kAllLanes, p.x, lane), __shfl_sync(kAllLanes, p.y, lane),
                         __shfl_sync(kAllLanes, p.z, lane)};
      offer(there, __shfl_sync(kAllLanes, original_of(p), lane), leaf * kLeafSize + Index(lane));
    }
    update_reach();
  }

  __device__ __forceinline__ void offer(Vec there, Index original, Index at) {
    const float distance = point::squared_length(there - position_of(mine_));
    if (!active_ || at == at_ || !(distance <= limit_) || !(distance < __int_as_float(0x7f800000)) ||
        !precedes(distance, original, kList - 1))
      return;
    bool before = true;
#pragma unroll
    for (int i = kList - 1; i > 0; --i) {
      const bool before_previous = precedes(distance, original, i - 1);
      distance_[i] = before_previous ? distance_[i - 1] : before ? distance : distance_[i];
      original_[i] = before_previous ? original_[i - 1] : before ? original : original_[i];
      position_[i] = before_previous ? position_[i - 1] : before ? at : position_[i];
      before = before_previous;
    }
    distance_[0] = before ? distance : distance_[0];
    original_[0] = before ? original : original_[0];
    position_[0] = before ? at : position_[0];
  }

  __device__ __forceinline__ void update_reach() {
    const float reach = fminf(distance_[kList - 1], limit_);
    boxes_.set_reach(
        active_ ? __float_as_uint(reach) : 0u, [](unsigned bits, float) { return __uint_as_float(bits); }, 0.0f);
    const bool at_end = reach == (boxes_.in_second ? boxes_.reach[1] : boxes_.reach[0]);
    last_original_ = warp_max(active_ && at_end ? original_[kList - 1] : 0u);
  }

  const Tree& tree_;
  Index leaf_, at_;
  float4 mine_;
  bool active_;
  QueryBoxes boxes_;
  float limit_ = 0;
  Index last_original_ = point::kNoNeighbor;
  float distance_[kList];
  Index original_[kList], position_[kList];
};

}  // namespace pointfair::cuda
