// SPDX-License-Identifier: Apache-2.0
// A thread a point, in sorted order, a warp a leaf. Everything runs over neighbours through `neighbors(visit)`, which
// calls visit(offset, sorted position) for each, always in the same order.
#include "cuda/stage_parts.cuh"
#include "cuda/wide_stages.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

class Listed {
 public:
  __device__ __forceinline__ Listed(const Tree& tree, const Surroundings& from, Index at, bool)
      : points_(tree.points), list_(from.lists.of(at)), k_(from.lists.k), here_(position_of(tree.points[at])) {}
  template <class Visit>
  __device__ __forceinline__ void operator()(Visit visit) const {
    for (int i = 0; i < k_; ++i) {
      const Index at = list_[i * kWarp];
      if (at == point::kNoNeighbor) return;
      visit(position_of(points_[at]) - here_, at);
    }
  }
  __device__ __forceinline__ float squared_radius() const { return 1; }  // lists have no width of their own

 private:
  const float4* points_;
  const Index* list_;
  int k_;
  Vec here_;
};

// Scatters indices over [0, 1) (multiplicative hashing with xor-shifts, after Wellons 2018), as src/cpu/stage_loops.h.
__device__ __forceinline__ float unit_hash(Index x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return static_cast<float>(x >> 8) * 0x1p-24f;
}

// In sorted order; the warp walks the tree for its leaf.
class InBall {
 public:
  __device__ __forceinline__ InBall(const Tree& tree, const Surroundings& from, Index at, bool active)
      : tree_(tree), at_(at), here_(position_of(tree.points[at])), box_(warp_box(here_, active)) {
    squared_radius_ = active ? from.balls.squared_radius[at] : -1.0f;
    farthest_ = unordered(warp_max(ordered(squared_radius_)));
    if (from.balls.widening > 0) {  // a surface holds widening * R^2 / r^2 points
      const float squared_widening = squared_radius_ - from.balls.squared_base;
      const float holds = squared_widening > 0 ? squared_radius_ / squared_widening : 1.0f;
      share_ = active ? (kBallPoints / static_cast<float>(from.balls.widening)) / holds : 0.0f;
    }
    largest_share_ = unordered(warp_max(ordered(share_)));
    is_thinned_ = __any_sync(kAllLanes, active && share_ < 1);
  }

  template <class Visit>
  __device__ __forceinline__ void operator()(Visit visit) const {
    const auto near = [&](const Box& other) { return squared_gap(other, box_) <= farthest_; };
    const auto near_group = [&](const BoxGroup& group) { return near(box_of_lane(group)); };
    Walk walk(tree_);
    for (Index leaf = walk.next(near_group); leaf != point::kNoNeighbor; leaf = walk.next(near_group)) {
      const float4 mine = tree_.points[leaf * kLeafSize + lane_number()];
      const Vec its_place = position_of(mine);
      const float hash = is_thinned_ ? unit_hash(original_of(mine)) : 0.0f;
      const bool counts = near({its_place, its_place}) && hash < largest_share_;
      for (unsigned all = __ballot_sync(kAllLanes, counts); all != 0; all &= all - 1) {
        const int lane = __ffs(static_cast<int>(all)) - 1;
        const Vec there = {__shfl_sync(kAllLanes, its_place.x, lane), __shfl_sync(kAllLanes, its_place.y, lane),
                           __shfl_sync(kAllLanes, its_place.z, lane)};
        const float its_hash = is_thinned_ ? __shfl_sync(kAllLanes, hash, lane) : 0.0f;
        const Vec offset = there - here_;
        const Index position = leaf * kLeafSize + Index(lane);
        if (position != at_ && point::squared_length(offset) <= squared_radius_ && its_hash < share_)
          visit(offset, position);
      }
    }
  }
  __device__ __forceinline__ float squared_radius() const { return squared_radius_; }

 private:
  const Tree& tree_;
  Index at_;
  Vec here_;
  Box box_;
  float squared_radius_, farthest_;
  float share_ = 1, largest_share_;
  bool is_thinned_;
};

__device__ __forceinline__ point::LocalNormalWeights<float> weights_of(const NormalRule& rule, float squared_radius) {
  if (rule.of_radius) return point::local_weights(rule.weights, squared_radius);
  return {rule.weights.inverse_two_sigma2, rule.weights.inverse_sigma2};
}
__device__ __forceinline__ point::LocalBilateralWeights<float> weights_of(const FairingRule& rule,
                                                                          float squared_radius) {
  if (rule.of_radius) return point::local_weights(rule.weights, squared_radius);
  return {rule.weights.inverse_two_closeness2, rule.weights.inverse_two_similarity2};
}

__global__ void __launch_bounds__(kBlock)
    radii(const __grid_constant__ Tree tree, Lists nearest, float squared_base, float* squared_radius) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const Vec here = position_of(tree.points[at]);
  float farthest = 0;
  for (int i = nearest.k - 1; i >= 0; --i) {
    const Index neighbor = nearest.of(at)[i * kWarp];
    if (neighbor == point::kNoNeighbor) continue;
    farthest = point::squared_length(position_of(tree.points[neighbor]) - here);
    break;
  }
  squared_radius[at] = farthest + squared_base;
}

template <class Neighbors>
__global__ void __launch_bounds__(kBlock) wide_normals(const __grid_constant__ Tree tree, CloudState* state,
                                                       Surroundings surroundings, NormalRule rule, Normals normals) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const bool valid = at < state->valid;
  const Neighbors neighbors(tree, surroundings, Index(at), valid);
  const auto weights = weights_of(rule, neighbors.squared_radius());
  const NormalOfPoint normal = normal_of(neighbors, weights);
  normals.set(at, valid ? normal.unit : Vec{});
  count_unmoved(state, valid && normal.too_few, valid && normal.none);
}

template <class Neighbors>
__global__ void __launch_bounds__(kBlock)
    filtered_normals(const __grid_constant__ Tree tree, Surroundings surroundings, NormalRule rule, float inverse_turn,
                     Normals from, Normals to) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const Neighbors neighbors(tree, surroundings, Index(at), at < tree.state->valid);
  const auto weights = weights_of(rule, neighbors.squared_radius());
  point::FilteredNormal<float> filtered(from.at(at));
  neighbors([&](Vec offset, Index there) { filtered.add(offset, from.at(there), true, weights, inverse_turn); });
  to.set(at, filtered.unit());
}

template <class Neighbors>
__device__ __forceinline__ float distance_along_normal(const Neighbors& neighbors, const FairingRule& rule,
                                                       Normals normals, Vec normal, AreaWeights areas) {
  const auto weights = weights_of(rule, neighbors.squared_radius());
  if (rule.two_planes) {
    point::TwoPlaneSum<float> sum;
    neighbors([&](Vec offset, Index there) {
      sum.add(offset, normal, normals.at(there), areas.of(there), true, weights, rule.inverse_turn);
    });
    return sum.distance();
  }
  point::BilateralSum<float> sum;
  neighbors([&](Vec offset, Index there) { sum.add(offset, normal, areas.of(there), true, weights); });
  return sum.distance();
}

template <class Neighbors>
__global__ void __launch_bounds__(kBlock)
    wide_fairing(const __grid_constant__ Tree tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                 FairingRule rule, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const bool valid = at < tree.state->valid;
  const Neighbors neighbors(tree, surroundings, Index(at), valid);
  const Vec normal = normals.at(at);
  const float distance = distance_along_normal(neighbors, rule, normals, normal, areas);
  const float4 p = tree.points[at];
  const Vec moved = point::moved(position_of(p), normal, distance * rule.strength);
  store_faired(faired, at, p, valid, moved);
}

}  // namespace

void measure_radii(Context& context, const Tree& tree, Lists nearest, float squared_base, float* squared_radius) {
  radii<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, nearest, squared_base, squared_radius);
  check(cudaGetLastError(), "measuring radii");
}

void estimate_wide_normals(Context& context, const Tree& tree, CloudState* state, Surroundings surroundings,
                           NormalRule rule, Normals normals) {
  const auto kernel = surroundings.lists.k == 0 ? wide_normals<InBall> : wide_normals<Listed>;
  kernel<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, state, surroundings, rule, normals);
  check(cudaGetLastError(), "estimating normals");
}

void filter_normals(Context& context, const Tree& tree, Surroundings surroundings, NormalRule rule, float inverse_turn,
                    Normals from, Normals to) {
  const auto kernel = surroundings.lists.k == 0 ? filtered_normals<InBall> : filtered_normals<Listed>;
  kernel<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, rule, inverse_turn, from,
                                                                           to);
  check(cudaGetLastError(), "filtering normals");
}

void fair_widely(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                 FairingRule rule, FairedPoints faired) {
  const auto kernel = surroundings.lists.k == 0 ? wide_fairing<InBall> : wide_fairing<Listed>;
  kernel<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, normals, areas, rule,
                                                                           faired);
  check(cudaGetLastError(), "fairing");
  bring_into_order(context, faired);
}

}  // namespace pointfair::cuda
