// SPDX-License-Identifier: Apache-2.0
// The k <= 1024 nearest points of one place: a warp to a query, exact, in the order of point::precedes. Visits the tree
// nearest box first; of leaves the two nearest, so that the points of both are on their way at once.
#pragma once

#include "cuda/index/tree.cuh"
#include "cuda/search/single_lists.cuh"

namespace pointfair::cuda {

// Where one warp stands in the tree.
struct SingleWalk {
  unsigned gaps[kMaxLevels][kWarp];  // bits of squared distances to the boxes still to be visited
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
  // Afterwards the list holds the nearest, sorted, kNoKey at the end. `root`: of the cloud, 0 where there is one.
  __device__ void run(Index root = 0) {
    int level = tree_.levels - 1;
    enter(level, root);
    while (level < tree_.levels) {
      const unsigned gap = walk_.gaps[level][lane_number()];
      const unsigned nearest = warp_min(gap);
      if (nearest == kVisited || nearest > last_bits() || __uint_as_float(nearest) > squared_limit_) {
        ++level;
        continue;
      }
      const Index group = walk_.groups[level];
      const BoxGroup& boxes = tree_.group(level, group);
      const int child = first_of(__ballot_sync(kAllLanes, gap == nearest), nearest, boxes);
      const unsigned rest = static_cast<int>(lane_number()) == child ? kVisited : gap, second = warp_min(rest);
      if (nearest == last_bits() && !comes_before_last(low_corner(boxes, child))) {
        ++level;  // nor can any other box of the group have a neighbour
        continue;
      }
      const int follower = __ffs(static_cast<int>(__ballot_sync(kAllLanes, rest == second))) - 1;
      const bool both = level == 0 && second != kVisited && second < last_bits();
      const int lane = static_cast<int>(lane_number());
      if (lane == child || (both && lane == follower)) walk_.gaps[level][lane] = kVisited;
      __syncwarp();
      const Index first = tree_.first_child(level, group), node = first + static_cast<Index>(child);
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

  __device__ bool precedes(Key a, Key b) const { return Precedes{tree_.points}(a, b); }
  __device__ unsigned last_bits() const { return static_cast<unsigned>(last_ >> 32); }
  // Whether a point there at the distance of the last would join.
  __device__ bool comes_before_last(Vec place) const {
    const Index at = point::key_index(last_);
    return at == point::kNoNeighbor || point::lies_before(place, position_of(tree_.points[at]));
  }

  // Of boxes equally near, the one whose points may lie before the others': from afar all distances may round to one
  // number. Of boxes around the query any, unless k points are at its place.
  __device__ int first_of(unsigned tied, unsigned gap, const BoxGroup& boxes) const {
    const bool any = gap == 0 && last_bits() > 0;
    for (int axis = 0; axis < 3 && __popc(tied) > 1 && !any; ++axis) {
      const bool counts = (tied >> lane_number() & 1u) != 0;
      const unsigned own = counts ? ordered_number(boxes.bound[axis][lane_number()]) : ~0u;
      unsigned least = own;
      for (int step = kWarp / 2; step > 0; step /= 2) least = min(least, __shfl_xor_sync(kAllLanes, least, step));
      tied = __ballot_sync(kAllLanes, counts && own == least);
    }
    return __ffs(static_cast<int>(tied)) - 1;
  }

  __device__ void enter(int level, Index group) {
    const Box box = box_of_lane(tree_.group(level, group));
    const float gap = squared_gap(box, {position_, position_});
    const bool exists = gap < __int_as_float(0x7f800000);
    walk_.gaps[level][lane_number()] = exists ? __float_as_uint(gap) : kVisited;
    walk_.groups[level] = group;
    __syncwarp();
    // From inside the cloud boxes rarely lie at one distance other than zero; from far away many do.
    const unsigned nearest = warp_min(walk_.gaps[level][lane_number()]);
    const unsigned tied = __ballot_sync(kAllLanes, exists && __float_as_uint(gap) == nearest);
    if (nearest > 0 && nearest < last_bits() && __popc(tied) > 1) bound_by_corners(box, exists);
  }

  // Each box has a point that is no farther than its farthest corner.
  __device__ void bound_by_corners(const Box& box, bool exists) {
    const Vec corner = {fmaxf(box.max.x - position_.x, position_.x - box.min.x),
                        fmaxf(box.max.y - position_.y, position_.y - box.min.y),
                        fmaxf(box.max.z - position_.z, position_.z - box.min.z)};
    const float distance = point::squared_length(corner);
    const unsigned bits = __float_as_uint(distance);
    const bool counts = exists && bits < last_bits() && distance < __int_as_float(0x7f800000);
    const unsigned counted = __ballot_sync(kAllLanes, counts);
    if (__popc(counted) < k_) return;
    int nearer = 0;
    for (int lane = 0; lane < kWarp; ++lane) {
      const unsigned other = __shfl_sync(kAllLanes, bits, lane);
      const bool first = other < bits || (other == bits && lane < static_cast<int>(lane_number()));
      nearer += (counted >> lane & 1u) != 0 && first;
    }
    const int kth = __ffs(static_cast<int>(__ballot_sync(kAllLanes, counts && nearer == k_ - 1))) - 1;
    last_ = point::neighbor_key(__shfl_sync(kAllLanes, distance, kth), point::kNoNeighbor);
  }

  // `p` is the leaf's point of this lane.
  __device__ void visit_leaf(Index leaf, float4 p) {
    const Index at = leaf * kLeafSize + lane_number();
    const float distance = point::squared_length(position_of(p) - position_);
    const Key key = point::neighbor_key(distance, at);
    const bool joins = distance <= squared_limit_ && distance < __int_as_float(0x7f800000) &&
                       original_of(p) != original_ && precedes(key, last_);
    list_.offer(joins, key);
    const Key kth = list_.key(k_ - 1);
    last_ = precedes(kth, last_) ? kth : last_;
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
