// SPDX-License-Identifier: Apache-2.0
// What the two searches of whole leaves share: the boxes of a leaf's queries, and the order in which leaves are
// visited.
#pragma once

#include "cuda/index/tree.cuh"

namespace pointfair::cuda {

// The queries of a leaf in one box, or in two, cut where consecutive points lie farthest apart: where the curve leaves
// the surface and comes back elsewhere, one box would be mostly empty. `reach` is how far, squared, each looks.
struct QueryBoxes {
  Box box[2];
  float reach[2];
  bool in_second;  // whether this lane belongs to the second
  bool split;      // whether there is a second; the same in every lane

  __device__ __forceinline__ QueryBoxes(Vec p, bool active) {
    const Vec step = {p.x - __shfl_up_sync(kAllLanes, p.x, 1), p.y - __shfl_up_sync(kAllLanes, p.y, 1),
                      p.z - __shfl_up_sync(kAllLanes, p.z, 1)};
    const unsigned jump = active && lane_number() > 0 ? __float_as_uint(point::squared_length(step)) : 0u;
    const unsigned longest = warp_max(jump);
    const int cut = __ffs(static_cast<int>(__ballot_sync(kAllLanes, jump == longest))) - 1;
    in_second = static_cast<int>(lane_number()) >= cut;
    box[0] = warp_box(p, active && !in_second);
    box[1] = warp_box(p, active && in_second);
    const Box all = both();
    split = squared_diagonal(box[0]) + squared_diagonal(box[1]) < 0.7f * squared_diagonal(all);
    if (split) return;
    box[0] = all;
    in_second = false;
  }

  __device__ static float squared_diagonal(const Box& b) { return point::squared_length(b.max - b.min); }
  __device__ Box both() const {
    return {{fminf(box[0].min.x, box[1].min.x), fminf(box[0].min.y, box[1].min.y), fminf(box[0].min.z, box[1].min.z)},
            {fmaxf(box[0].max.x, box[1].max.x), fmaxf(box[0].max.y, box[1].max.y), fmaxf(box[0].max.z, box[1].max.z)}};
  }
  __device__ Box all() const { return split ? both() : box[0]; }

  // The lanes' reaches as ordered bits; 0 for a lane that does not search. Both maxima are always taken: see warp_max.
  __device__ __forceinline__ void set_reach(unsigned bits, float (*to_squared)(unsigned, float), float factor) {
    const unsigned first = warp_max(in_second ? 0u : bits), second = warp_max(in_second ? bits : 0u);
    reach[0] = to_squared(first, factor);
    reach[1] = to_squared(second, factor);
  }
};

// Leaves in the order of a group's search, its own left out: those beside it on the curve, for an early limit, then all
// that are near.
class LeafOrder {
 public:
  __device__ __forceinline__ LeafOrder(const Tree& tree, Index own, Index beside)
      : walk_(tree, tree.root_over(own)), own_(own) {
    const LeafRange cloud = tree.leaves_beside(own);
    first_ = next_ = own > cloud.begin + beside ? own - beside : cloud.begin;
    last_ = min(own + beside, cloud.end - 1);
  }

  // kNoNeighbor at the end.
  template <class Near>
  __device__ __forceinline__ Index next(Near near) {
    if (next_ == own_) ++next_;
    if (next_ <= last_) return next_++;
    Index leaf;
    do {
      leaf = walk_.next(near);
    } while (leaf >= first_ && leaf <= last_);
    return leaf;
  }

 private:
  Walk walk_;
  Index own_, first_, last_, next_;
};

}  // namespace pointfair::cuda
