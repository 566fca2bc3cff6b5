// SPDX-License-Identifier: Apache-2.0
// The k <= 1024 nearest points of one place: a warp to a query, exact, ties by original index. Visits the tree nearest
// box first; of leaves the two nearest, so that the points of both are on their way at once.
#pragma once

#include "cuda/single_lists.cuh"
#include "cuda/tree.cuh"

namespace pointfair::cuda {

// Where one warp stands in the tree.
struct SingleWalk {
  unsigned gaps[kMaxLevels][kWarp];         // bits of squared distances to the boxes still to be visited
  Index least_original[kMaxLevels][kWarp];  // of these boxes
  Index groups[kMaxLevels];
};

template <class List>
class SingleSearch {
 public:
  // `original` names the point that is not its own neighbour.
  __device__ SingleSearch(const Tree& tree, SingleWalk& walk, List& list, Vec position, Index original, int k,
                          float squared_limit)
      : tree_(tree),
        walk_(walk),
        list_(list),
        position_(position),
        original_(original),
        k_(k),
        squared_limit_(squared_limit) {}

  // What is beyond this squared distance is no neighbour.
  __device__ void bound(float squared) {
    if (squared < __int_as_float(0x7f800000)) last_ = point::neighbor_key(squared, point::kNoNeighbor);
  }
  // Afterwards the list holds the nearest, sorted, kNoKey at the end.
  __device__ void run() {
    int level = tree_.levels - 1;
    enter(level, 0);
    while (level < tree_.levels) {
      const unsigned gap = walk_.gaps[level][lane_number()];
      const unsigned nearest = warp_min(gap);
      if (nearest == kVisited || nearest > last_bits() || __uint_as_float(nearest) > squared_limit_) {
        ++level;
        continue;
      }
      const int child = first_of(__ballot_sync(kAllLanes, gap == nearest), nearest, level);
      const Index group = walk_.groups[level];
      const unsigned rest = static_cast<int>(lane_number()) == child ? kVisited : gap, second = warp_min(rest);
      if (nearest == last_bits() && walk_.least_original[level][child] > last_original()) {
        ++level;  // nor can any other box of the group have a neighbour
        continue;
      }
      const int follower = __ffs(static_cast<int>(__ballot_sync(kAllLanes, rest == second))) - 1;
      const bool both = level == 0 && second != kVisited && second < last_bits();
      const int lane = static_cast<int>(lane_number());
      if (lane == child || (both && lane == follower)) walk_.gaps[level][lane] = kVisited;
      __syncwarp();
      const Index first = group * kLeafSize, node = first + static_cast<Index>(child);
      if (level == 0) {
        const Index next = both ? first + static_cast<Index>(follower) : node;
        const float4 p = tree_.points[node * kLeafSize + lane_number()];
        const float4 q = tree_.points[next * kLeafSize + lane_number()];
        visit_leaf(node, p);
        if (both) visit_leaf(next, q);
      } else {
        enter(--level, node);
      }
    }
    list_.finish();
  }

 private:
  static constexpr unsigned kVisited = ~0u;

  __device__ unsigned last_bits() const { return static_cast<unsigned>(last_ >> 32); }
  __device__ Index last_original() const { return static_cast<Index>(last_); }

  // Of boxes equally near, the one with the least original index: from afar all distances may round to one number. Of
  // boxes around the query any, unless k points are at its place.
  __device__ int first_of(unsigned tied, unsigned gap, int level) const {
    if (__popc(tied) == 1 || (gap == 0 && last_bits() > 0)) return __ffs(static_cast<int>(tied)) - 1;
    const bool mine = (tied >> lane_number() & 1u) != 0;
    Index least = mine ? walk_.least_original[level][lane_number()] : point::kNoNeighbor;
    const Index own = least;
    for (int step = kWarp / 2; step > 0; step /= 2) least = min(least, __shfl_xor_sync(kAllLanes, least, step));
    return __ffs(static_cast<int>(__ballot_sync(kAllLanes, mine && own == least))) - 1;
  }

  __device__ void enter(int level, Index group) {
    const BoxGroup& boxes = tree_.group(level, group);
    const Box box = box_of_lane(boxes);
    const float gap = squared_gap(box, {position_, position_});
    const bool exists = gap < __int_as_float(0x7f800000);
    walk_.gaps[level][lane_number()] = exists ? __float_as_uint(gap) : kVisited;
    walk_.least_original[level][lane_number()] = boxes.least_original[lane_number()];
    walk_.groups[level] = group;
    __syncwarp();
    // From inside the cloud boxes rarely lie at one distance other than zero; from far away many do.
    const unsigned nearest = warp_min(walk_.gaps[level][lane_number()]);
    const unsigned tied = __ballot_sync(kAllLanes, exists && __float_as_uint(gap) == nearest);
    if (nearest > 0 && nearest < last_bits() && __popc(tied) > 1)
      bound_by_corners(box, boxes.least_original[lane_number()], exists);
  }

  // Each box has a point that is no farther than its farthest corner, and one of its least original index. From far
  // away, where all distances round to one number, these k points may already be the nearest.
  __device__ void bound_by_corners(const Box& box, Index least_original, bool exists) {
    const Vec corner = {fmaxf(box.max.x - position_.x, position_.x - box.min.x),
                        fmaxf(box.max.y - position_.y, position_.y - box.min.y),
                        fmaxf(box.max.z - position_.z, position_.z - box.min.z)};
    const float distance = point::squared_length(corner);
    const Key key = point::neighbor_key(distance, least_original);
    const bool counts = exists && key < last_ && distance < __int_as_float(0x7f800000) && least_original != original_;
    if (__popc(__ballot_sync(kAllLanes, counts)) < k_) return;
    RegisterList corners;
    corners.offer(counts, key, 0);
    last_ = corners.key(k_ - 1) + 1;
  }

  // `p` is the leaf's point of this lane.
  __device__ void visit_leaf(Index leaf, float4 p) {
    const Index at = leaf * kLeafSize + lane_number();
    const float distance = point::squared_length(position_of(p) - position_);
    const Key key = point::neighbor_key(distance, original_of(p));
    const bool joins = distance <= squared_limit_ && distance < __int_as_float(0x7f800000) &&
                       original_of(p) != original_ && key < last_;
    list_.offer(joins, key, at);
    const Key kth = list_.key(k_ - 1);
    last_ = kth < last_ ? kth : last_;
  }

  const Tree& tree_;
  SingleWalk& walk_;
  List& list_;
  Vec position_;
  Index original_;
  int k_;
  float squared_limit_;
  Key last_ = kNoKey;  // the k-th found so far, or a bound of it
};

}  // namespace pointfair::cuda
