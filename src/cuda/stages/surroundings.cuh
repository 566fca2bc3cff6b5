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
  bool along_mesh = false;  // collected are balls along a mesh, which hold what may lie within grown radii
};

class Listed {
 public:
  using Number = float;
  using Kernel = point::Gaussian;
  static constexpr bool kListed = true;
  using Count = int;
  struct Shared {};
  __device__ __forceinline__ Listed(const Tree& tree, const Surroundings& from, Index at, bool, Shared&)
      : points_(tree.points),
        list_(from.lists.list_of(at)),
        k_(from.lists.length_of(at)),
        here_(position_of(tree.points[at])) {}

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

// The neighbourhood of one point; of one that is not `active` it is empty.
struct Reach {
  __device__ __forceinline__ Reach(const Tree& tree, const point::Radii& radii, Index at, bool active) {
    const float own = active ? radii.squared_radius[at] : -1.0f;
    squared_radius = active && radii.squared_growth != nullptr ? own * radii.squared_growth[at] : own;
    const point::Radii its = radii_of(tree.settings_over(at / kLeafSize), radii);
    if (its.min_neighbors > 0)
      share = active ? point::kept_share(its, value_or_one(its.squared_level, at), own, squared_radius) : 0.0f;
    is_thinned = __any_sync(kAllLanes, active && share < 1);
  }

  float squared_radius;
  float share = 1;  // points with a hash below it are neighbours
  bool is_thinned;  // in any lane
};

// What was loaded of one point, in shared memory.
template <class Loaded>
struct alignas(sizeof(float4)) Slot {
  static_assert(sizeof(Loaded) <= sizeof(float4));
  Loaded value;
};

// The box of a warp's points and the largest of their squared radii.
struct WarpReach {
  __device__ __forceinline__ WarpReach(Vec here, bool active, float squared_radius)
      : box(warp_box(here, active)), farthest(unordered(warp_max(ordered(squared_radius)))) {}

  Box box;
  float farthest;
};

// The leaves that a radius of the warp reaches, in sorted order.
class ReachedLeaves {
 public:
  __device__ __forceinline__ ReachedLeaves(const Tree& tree, const Stop& stop, Index at, Vec here, float squared_radius,
                                           const WarpReach& warp)
      : stop_(stop),
        at_(at),
        here_(here),
        squared_radius_(squared_radius),
        warp_(warp),
        walk_(tree, tree.root_over(at / kLeafSize)) {}

  // The next, kNoNeighbor after the last, and after a stop that is heard; not to be called again then.
  __device__ __forceinline__ Index next() {
    const Index leaf = walk_.next([this](const BoxGroup& group) { return is_near(box_of_lane(group)); });
    if (visited_++ % kBetweenLooks == 0 && stop_.is_heard(at_ / kLeafSize + visited_ / kBetweenLooks))
      return point::kNoNeighbor;
    return leaf;
  }
  // Whether a point is as near to the warp's as its farthest radius.
  __device__ __forceinline__ bool is_near(Vec point) const {
    return squared_gap({point, point}, warp_.box) <= warp_.farthest;
  }

 private:
  // Whether a radius of the warp reaches this lane's box. Most boxes are near that of the whole warp or they are not; a
  // leaf that the curve has torn apart is wide, and its points are asked one by one.
  __device__ __forceinline__ bool is_near(const Box& box) const {
    bool result = false;
    for (unsigned near = __ballot_sync(kAllLanes, squared_gap(box, warp_.box) <= warp_.farthest); near != 0;
         near &= near - 1) {
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

  static constexpr unsigned kBetweenLooks = 32;  // leaves

  const Stop& stop_;
  Index at_;
  Vec here_;
  float squared_radius_;
  const WarpReach& warp_;
  Walk walk_;
  unsigned visited_ = 0;
};

// The warp walks the tree for its leaf.
class WalkedRadius {
 public:
  using Number = float;
  using Kernel = point::CompactGaussian;
  static constexpr bool kListed = false;
  using Count = int;
  struct Shared {
    float4 place[kWarp], loaded[kWarp];
    float hash[kWarp];
  };
  __device__ __forceinline__ WalkedRadius(const Tree& tree, const Surroundings& from, Index at, bool active,
                                          Shared& shared)
      : tree_(tree),
        stop_(from.stop),
        at_(at),
        here_(position_of(tree.points[at])),
        reach_(tree, from.radii, at, active),
        warp_(here_, active, reach_.squared_radius),
        shared_(shared) {}

  template <class Load, class Visit>
  __device__ __forceinline__ void operator()(Load load, Visit visit) const {
    using Loaded = decltype(load(Index{}));
    constexpr bool kLoads = !std::is_empty_v<Loaded>;
    auto* const loaded = reinterpret_cast<Slot<Loaded>*>(shared_.loaded);
    ReachedLeaves leaves(tree_, stop_, at_, here_, reach_.squared_radius, warp_);
    for (Index leaf = leaves.next(); leaf != point::kNoNeighbor; leaf = leaves.next()) {
      // each lane asks whether its point of the leaf is near the warp's, before all lanes look at it
      const Index mine = leaf * kLeafSize + lane_number();
      const float4 p = tree_.points[mine];
      const bool near = leaves.is_near(position_of(p));
      const unsigned all = __ballot_sync(kAllLanes, near);
      const int place = __popc(all & lanes_below()), count = __popc(all);
      if (near) {
        shared_.place[place] = p;
        if constexpr (kLoads) loaded[place].value = load(mine);
        if (reach_.is_thinned) shared_.hash[place] = tree_.share[mine];
      }
      const int own = at_ / kLeafSize == leaf ? place : kWarp;  // none is its own neighbour
      __syncwarp();
      const auto visit_all = [&](auto is_other) {  // most leaves are other ones, and whole
#pragma unroll(kAtOnce)
        for (int i = 0; i < count; ++i) {
          const Vec offset = position_of(shared_.place[i]) - here_;
          bool inside = point::squared_length(offset) <= reach_.squared_radius;
          if constexpr (!is_other.value)
            inside = inside && i != own && (!reach_.is_thinned || shared_.hash[i] < reach_.share);
          if constexpr (kLoads) {
            visit(offset, loaded[i].value, inside);
          } else {
            visit(offset, Loaded{}, inside);
          }
        }
      };
      if (at_ / kLeafSize != leaf && !reach_.is_thinned) {
        visit_all(std::true_type{});
      } else {
        visit_all(std::false_type{});
      }
      __syncwarp();
    }
  }
  __device__ __forceinline__ float squared_radius() const { return reach_.squared_radius; }
  __device__ __forceinline__ float squared_core() const { return point::squared_core(reach_.squared_radius); }
  __device__ __forceinline__ float squared_horizon() const { return reach_.share < 1 ? 0 : reach_.squared_radius; }
  __device__ __forceinline__ static bool any(bool mask) { return __any_sync(kAllLanes, mask); }

 private:
  static constexpr int kAtOnce = 4;  // points

  const Tree& tree_;
  const Stop& stop_;
  Index at_;
  Vec here_;
  Reach reach_;
  WarpReach warp_;
  Shared& shared_;
};

// The warp reads the parts of its groups, one of each at a time. Parts of balls along a mesh hold more than what lies
// within the radius, and not all that does.
template <bool kBalls>
class CollectedParts {
 public:
  using Number = float;
  using Kernel = point::CompactGaussian;
  static constexpr bool kListed = false;
  using Count = int;
  struct Shared {
    // of each group, with one unused, so that those of different groups lie in different banks
    float4 place[kGroups][kWarp + 1], loaded[kGroups][kWarp + 1];
  };
  __device__ __forceinline__ CollectedParts(const Tree& tree, const Surroundings& from, Index at, bool active,
                                            Shared& shared)
      : from_(from),
        points_(tree.points),
        collected_(from.collected),
        stop_(from.stop),
        at_(at),
        here_(position_of(tree.points[at])),
        shared_(shared) {
    squared_radius_ = active ? from.radii.squared_radius[at] : -1.0f;
    if constexpr (kBalls)
      if (active && from.radii.squared_growth != nullptr)
        squared_radius_ = squared_radius_ * from.radii.squared_growth[at];
  }

  template <class Load, class Visit>
  __device__ __forceinline__ void operator()(Load load, Visit visit) const {
    using Loaded = decltype(load(Index{}));
    constexpr bool kLoads = !std::is_empty_v<Loaded>;
    float4* const place = shared_.place[group_of_lane()];
    auto* const loaded = reinterpret_cast<Slot<Loaded>*>(shared_.loaded[group_of_lane()]);
    const Index any_valid = at_ - lane_number();  // of a part's empty places, which add nothing
    unsigned read = 0;
    for (Index part = collected_.first[at_ / kGroup]; __any_sync(kAllLanes, part != point::kNoNeighbor);) {
      if (read++ % kBetweenLooks == 0 && stop_.is_heard(at_ / kLeafSize + read / kBetweenLooks)) return;
      const bool has = part != point::kNoNeighbor;
      const NeighborPart& its = collected_.parts[has ? part : 0];
      const unsigned inside = has ? its.inside[lane_in_group()] : 0;
      const Index next = has ? collected_.next[part] : part;
      int rows = 0;
#pragma unroll
      for (int row = 0; row < kRows; ++row) {
        const unsigned slot = row * kGroup + lane_in_group();
        const Index position = has ? its.position[slot] : point::kNoNeighbor;
        const bool held = position != point::kNoNeighbor;
        const Index there = held ? position : any_valid;
        place[slot] = points_[there];
        if constexpr (kLoads) loaded[slot].value = load(there);
        if (__any_sync(kAllLanes, held)) rows = row + 1;
      }
      __syncwarp();
#pragma unroll 1
      for (int row = 0; row < rows; ++row) {
        const float4* const places = place + row * kGroup;
        const Slot<Loaded>* const values = loaded + row * kGroup;
        const unsigned bits = inside >> (row * kGroup);
#pragma unroll
        for (int i = 0; i < kGroup; ++i) {
          const Vec offset = position_of(places[i]) - here_;
          bool is_inside = (bits >> i & 1u) != 0;
          if constexpr (kBalls) is_inside = is_inside && point::squared_length(offset) <= squared_radius_;
          if constexpr (kLoads) {
            visit(offset, values[i].value, is_inside);
          } else {
            visit(offset, Loaded{}, is_inside);
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
    if constexpr (kBalls) return 0;
    const point::Radii& radii = from_.radii;
    if (radii.min_neighbors == 0) return squared_radius_;
    const float level = value_or_one(radii.squared_level, at_);
    return point::kept_share(radii, level, squared_radius_, squared_radius_) < 1 ? 0 : squared_radius_;
  }
  __device__ __forceinline__ static bool any(bool mask) { return __any_sync(kAllLanes, mask); }

 private:
  static constexpr int kRows = kWarp / kGroup;   // of a part
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

using CollectedRadius = CollectedParts<false>;
using MeshBalls = CollectedParts<true>;

// Calls launch(way) with the way to the neighbours that `surroundings` have, by its type; for_radius() where they are
// no lists.
template <class Way>
struct By {
  using Neighbors = Way;
};
template <class Launch>
void for_radius(const Surroundings& surroundings, Launch launch) {
  if (surroundings.along_mesh) {
    launch(By<MeshBalls>{});
  } else if (surroundings.collected.parts != nullptr) {
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
