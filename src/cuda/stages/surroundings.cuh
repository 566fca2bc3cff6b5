// SPDX-License-Identifier: Apache-2.0
// The ways to the neighbours of a warp's 32 points, which are a leaf (src/point/neighborhoods.h); handles are sorted
// positions, and all lanes of the warp call. Everything within a radius comes in ascending order along the curve.
#pragma once

#include <type_traits>

#include "cuda/runtime/stop.cuh"
#include "cuda/stages/collected.cuh"
#include "cuda/stages/list_stages.cuh"
#include "point/stages.h"

namespace pointfair::cuda {

// Lists, or everything within a radius if lists.k is 0, which lacks neighbours after a stop that is heard.
struct Surroundings {
  Lists lists;
  point::Radii radii;
  CollectedNeighbors collected;
  Stop stop;
};

class Listed {
 public:
  using Number = float;
  using Kernel = point::Gaussian;
  static constexpr bool kListed = true;
  using Count = int;
  struct Shared {};
  __device__ __forceinline__ Listed(const Tree& tree, const Surroundings& from, Index at, bool, Shared&)
      : points_(tree.points), list_(from.lists.of(at)), k_(from.lists.k), here_(position_of(tree.points[at])) {}

  template <class Load, class Visit>
  __device__ __forceinline__ void operator()(Load load, Visit visit) const {
    for (int i = 0; i < k_; ++i) {
      const Index at = list_[i * kWarp];
      if (at == point::kNoNeighbor) return;
      visit(position_of(points_[at]) - here_, load(at), true);
    }
  }
  __device__ __forceinline__ float squared_radius() const { return 1; }  // lists have no width of their own
  __device__ __forceinline__ float squared_core() const { return __int_as_float(0x7f800000); }
  __device__ __forceinline__ float squared_horizon() const { return 0; }
  __device__ __forceinline__ static bool any(bool mask) { return __any_sync(kAllLanes, mask); }

 private:
  const float4* points_;
  const Index* list_;
  int k_;
  Vec here_;
};

// Of a sorted point; null: 1.
__device__ __forceinline__ float value_or_one(const float* values, std::size_t at) {
  return values == nullptr ? 1.0f : values[at];
}

// The warp walks the tree for its leaf.
class WalkedRadius {
 public:
  using Number = float;
  using Kernel = point::CompactGaussian;
  static constexpr bool kListed = false;
  using Count = int;
  struct Shared {
    float4 place[kWarp];
  };
  __device__ __forceinline__ WalkedRadius(const Tree& tree, const Surroundings& from, Index at, bool active,
                                          Shared& shared)
      : WalkedRadius(tree, from.radii, from.stop, at, active, shared) {}
  __device__ __forceinline__ WalkedRadius(const Tree& tree, const point::Radii& radii, const Stop& stop, Index at,
                                          bool active, Shared& shared)
      : tree_(tree),
        stop_(stop),
        at_(at),
        here_(position_of(tree.points[at])),
        box_(warp_box(here_, active)),
        shared_(shared) {
    const float own = active ? radii.squared_radius[at] : -1.0f;
    squared_radius_ = active && radii.squared_growth != nullptr ? own * radii.squared_growth[at] : own;
    farthest_ = unordered(warp_max(ordered(squared_radius_)));
    const point::Radii its = radii_of(tree.settings_over(at / kLeafSize), radii);
    if (its.min_neighbors > 0)
      share_ = active ? point::kept_share(its, value_or_one(its.squared_level, at), own, squared_radius_) : 0.0f;
    is_thinned_ = __any_sync(kAllLanes, active && share_ < 1);
  }

  // visit(leaf, inside) for each leaf with a point within a radius, in sorted order: bit i of `inside` says that the
  // leaf's i-th point lies in that of this lane. The points are in `place` meanwhile.
  template <class Visit>
  __device__ __forceinline__ void for_leaves(Visit visit) const {
    const auto is_near = [&](const BoxGroup& group) { return this->is_near(box_of_lane(group)); };
    Walk walk(tree_, tree_.root_over(at_ / kLeafSize));
    unsigned visited = 0;
    for (Index leaf = walk.next(is_near); leaf != point::kNoNeighbor; leaf = walk.next(is_near)) {
      if (visited++ % kBetweenLooks == 0 && stop_.is_heard(at_ / kLeafSize + visited / kBetweenLooks)) return;
      const float4 mine = tree_.points[leaf * kLeafSize + lane_number()];
      shared_.place[lane_number()] = mine;
      __syncwarp();
      unsigned inside = points_inside();
      if (at_ / kLeafSize == leaf) inside &= ~(1u << lane_number());  // none is its own neighbour
      if (is_thinned_) inside = thinned(inside, tree_.share[leaf * kLeafSize + lane_number()]);
      if (__any_sync(kAllLanes, inside != 0)) visit(leaf, inside);
      __syncwarp();
    }
  }

  template <class Load, class Visit>
  __device__ __forceinline__ void operator()(Load load, Visit visit) const {
    for_leaves([&](Index leaf, unsigned inside) {
      for (unsigned all = warp_or(inside); all != 0; all &= all - 1) {
        const int i = __ffs(static_cast<int>(all)) - 1;
        visit(position_of(shared_.place[i]) - here_, load(leaf * kLeafSize + Index(i)), (inside >> i & 1u) != 0);
      }
    });
  }
  __device__ __forceinline__ float squared_radius() const { return squared_radius_; }
  __device__ __forceinline__ float squared_core() const { return point::squared_core(squared_radius_); }
  __device__ __forceinline__ float squared_horizon() const { return share_ < 1 ? 0 : squared_radius_; }
  __device__ __forceinline__ static bool any(bool mask) { return __any_sync(kAllLanes, mask); }

 private:
  // Whether a radius of the warp reaches this lane's box. Most boxes are near that of the whole warp or they are not; a
  // leaf that the curve has torn apart is wide, and its points are asked one by one.
  __device__ __forceinline__ bool is_near(const Box& box) const {
    bool result = false;
    for (unsigned near = __ballot_sync(kAllLanes, squared_gap(box, box_) <= farthest_); near != 0; near &= near - 1) {
      const int child = __ffs(static_cast<int>(near)) - 1;
      const Box its_box = {from_lane(box.min, child), from_lane(box.max, child)};
      const bool reached = __any_sync(kAllLanes, squared_gap(its_box, {here_, here_}) <= squared_radius_);
      result = result || (reached && static_cast<int>(lane_number()) == child);
    }
    return result;
  }
  __device__ __forceinline__ static Vec from_lane(Vec v, int lane) {
    return {__shfl_sync(kAllLanes, v.x, lane), __shfl_sync(kAllLanes, v.y, lane), __shfl_sync(kAllLanes, v.z, lane)};
  }
  __device__ __forceinline__ unsigned points_inside() const {
    unsigned inside = 0;
#pragma unroll
    for (int i = 0; i < kWarp; ++i)
      if (point::squared_length(position_of(shared_.place[i]) - here_) <= squared_radius_) inside |= 1u << i;
    return inside;
  }
  __device__ __forceinline__ unsigned thinned(unsigned inside, float hash) const {
    for (unsigned all = warp_or(inside); all != 0; all &= all - 1) {
      const int i = __ffs(static_cast<int>(all)) - 1;
      if (!(__shfl_sync(kAllLanes, hash, i) < share_)) inside &= ~(1u << i);
    }
    return inside;
  }

  static constexpr unsigned kBetweenLooks = 32;  // leaves

  const Tree& tree_;
  const Stop& stop_;
  Index at_;
  Vec here_;
  Box box_;
  Shared& shared_;
  float squared_radius_, farthest_;
  float share_ = 1;
  bool is_thinned_;
};

// The warp reads the parts of its leaf.
class CollectedRadius {
 public:
  using Number = float;
  using Kernel = point::CompactGaussian;
  static constexpr bool kListed = false;
  using Count = int;
  struct Shared {
    float4 place[kWarp], loaded[kWarp];
  };
  __device__ __forceinline__ CollectedRadius(const Tree& tree, const Surroundings& from, Index at, bool active,
                                             Shared& shared)
      : from_(from),
        points_(tree.points),
        collected_(from.collected),
        stop_(from.stop),
        at_(at),
        here_(position_of(tree.points[at])),
        shared_(shared) {
    squared_radius_ = active ? from.radii.squared_radius[at] : -1.0f;
  }

  template <class Load, class Visit>
  __device__ __forceinline__ void operator()(Load load, Visit visit) const {
    using Loaded = decltype(load(Index{}));
    static_assert(sizeof(Loaded) <= sizeof(float4));
    constexpr bool kLoads = !std::is_empty_v<Loaded>;
    const auto loaded = reinterpret_cast<Loaded*>(shared_.loaded);
    unsigned read = 0;
    for (Index part = collected_.first[at_ / kLeafSize]; part != point::kNoNeighbor;) {
      if (read++ % kBetweenLooks == 0 && stop_.is_heard(at_ / kLeafSize + read / kBetweenLooks)) return;
      const unsigned lane = lane_number();
      const Index next = collected_.next[part], position = collected_.parts[part].position[lane];
      const unsigned inside = collected_.parts[part].inside[lane];
      const bool held = position != point::kNoNeighbor;
      const int count = __popc(__ballot_sync(kAllLanes, held));
      const Index from = held ? position : at_ - lane;  // any valid point: what no lane holds adds nothing
      shared_.place[lane] = points_[from];
      if constexpr (kLoads) loaded[lane] = load(from);
      __syncwarp();
      for (int first = 0; first < count; first += kAtOnce) {
        const unsigned bits = inside >> first;
#pragma unroll
        for (int i = 0; i < kAtOnce; ++i) {
          const Vec offset = position_of(shared_.place[first + i]) - here_;
          if constexpr (kLoads) {
            visit(offset, loaded[first + i], (bits >> i & 1u) != 0);
          } else {
            visit(offset, Loaded{}, (bits >> i & 1u) != 0);
          }
        }
      }
      __syncwarp();
      part = next;
    }
  }
  __device__ __forceinline__ float squared_radius() const { return squared_radius_; }
  __device__ __forceinline__ float squared_core() const { return point::squared_core(squared_radius_); }
  __device__ __forceinline__ float squared_horizon() const {
    const point::Radii& radii = from_.radii;
    if (radii.min_neighbors == 0) return squared_radius_;
    const float level = value_or_one(radii.squared_level, at_);
    return point::kept_share(radii, level, squared_radius_, squared_radius_) < 1 ? 0 : squared_radius_;
  }
  __device__ __forceinline__ static bool any(bool mask) { return __any_sync(kAllLanes, mask); }

 private:
  static constexpr int kAtOnce = 4;              // independent until they are added up
  static constexpr unsigned kBetweenLooks = 32;  // parts

  const Surroundings& from_;
  const float4* points_;
  CollectedNeighbors collected_;
  const Stop& stop_;
  Index at_;
  Vec here_;
  Shared& shared_;
  float squared_radius_;
};

// Calls launch(way) with the way to the neighbours that `surroundings` have, by its type; for_radius() where they are
// no lists.
template <class Way>
struct By {
  using Neighbors = Way;
};
template <class Launch>
void for_radius(const Surroundings& surroundings, Launch launch) {
  if (surroundings.collected.parts != nullptr) {
    launch(By<CollectedRadius>{});
  } else {
    launch(By<WalkedRadius>{});
  }
}
template <class Launch>
void for_way(const Surroundings& surroundings, Launch launch) {
  if (surroundings.lists.k > 0) {
    launch(By<Listed>{});
  } else {
    for_radius(surroundings, launch);
  }
}

}  // namespace pointfair::cuda
