// SPDX-License-Identifier: Apache-2.0
// A thread a point, in sorted order, a warp a leaf, over the neighbours of src/cuda/surroundings.cuh.
#include "cuda/stage_parts.cuh"
#include "cuda/wide_stages.cuh"
#include "point/outliers.h"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

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
  __shared__ typename Neighbors::Shared shared[kWarps];
  const bool valid = tree.holds(at);
  const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
  const auto weights = weights_of(rule, neighbors.squared_radius());
  const NormalOfPoint normal = normal_of(neighbors, weights);
  normals.set(at, valid ? normal.unit : Vec{});
  count_unmoved(state, valid && normal.too_few, valid && normal.none);
}

// What the sums read of a neighbour beside its place.
struct __align__(16) Plane {
  Vec normal;
  float area;  // weight
};

template <class Neighbors>
__global__ void __launch_bounds__(kBlock)
    filtered_normals(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings,
                     NormalRule rule, float inverse_turn, Normals from, Normals to, GrowthOut growth) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const Neighbors neighbors(tree, surroundings, Index(at), tree.holds(at), shared[threadIdx.x / kWarp]);
  const auto weights = weights_of(rule, neighbors.squared_radius());
  point::FilteredNormal<float> filtered(from.at(at));
  const auto load = [&](Index there) { return Plane{from.at(there), 0}; };
  if (growth.squared_growth == nullptr) {
    neighbors(load, [&](Vec offset, Plane there, bool inside) {
      filtered.add(offset, there.normal, inside, weights, inverse_turn);
    });
  } else {
    point::MeanTurn<float> turn;
    neighbors(load, [&](Vec offset, Plane there, bool inside) {
      filtered.add(offset, there.normal, inside, weights, inverse_turn);
      turn.add(point::dot(filtered.normal, there.normal), inside);
    });
    growth.squared_growth[at] = turn.squared_growth(growth.most);
  }
  to.set(at, filtered.unit());
}

template <class Neighbors, class Weights, class Visited>
__device__ __forceinline__ float bilateral_distance(const Neighbors& neighbors, Weights weights,
                                                    const FairingRule& rule, Normals normals, Vec normal,
                                                    AreaWeights areas, Visited visited) {
  if (rule.two_planes) {
    point::TwoPlaneSum<float> sum;
    neighbors(
        [&](Index there) {
          return Plane{normals.at(there), areas.of(there)};
        },
        [&](Vec offset, Plane there, bool inside) {
          visited(offset, inside);
          sum.add(offset, normal, there.normal, there.area, inside, weights, rule.inverse_turn);
        });
    return sum.distance();
  }
  point::BilateralSum<float> sum;
  neighbors([&](Index there) { return areas.of(there); },
            [&](Vec offset, float area, bool inside) {
              visited(offset, inside);
              sum.add(offset, normal, area, inside, weights);
            });
  return sum.distance();
}

// Where the point goes: along its normal; an outlier becomes NaN or goes to a mean of its neighbours. All lanes of
// the warp take part.
template <class Neighbors>
__device__ __forceinline__ Vec fair_point(const Neighbors& neighbors, const FairingRule& rule, Vec here, Vec normal,
                                          Normals normals, AreaWeights areas, bool valid) {
  const auto weights = weights_of(rule, neighbors.squared_radius());
  if (rule.squared_outlier_distance == 0) {
    const float distance = bilateral_distance(neighbors, weights, rule, normals, normal, areas, [](Vec, bool) {});
    return point::moved(here, normal, distance * rule.strength);
  }
  point::Agreement<float> agreement;
  const float squared_core = point::larger(neighbors.squared_core(), rule.squared_outlier_distance);
  const float distance =
      bilateral_distance(neighbors, weights, rule, normals, normal, areas, [&](Vec offset, bool inside) {
        agreement.add(offset, normal, inside, rule.squared_outlier_distance, squared_core);
      });
  const Vec there = point::moved(here, normal, distance * rule.strength);
  // a point without a normal keeps its place
  const bool is_sparse = neighbors.squared_core() > rule.squared_sparse_core;
  const bool outlier = valid && agreement.is_missing(is_sparse) && point::squared_length(normal) > 0;
  if (!__any_sync(kAllLanes, outlier)) return there;
  const float nan = __int_as_float(0x7fffffff);
  if (!rule.pull_outliers) return outlier ? Vec{nan, nan, nan} : there;
  point::PullSum<float> sum;
  if (rule.squared_radius == nullptr) {
    neighbors(
        [&](Vec offset, auto, bool inside) { sum.add_by_closeness(offset, inside, weights.inverse_two_closeness2); });
  } else {
    neighbors([&](Index there) { return rule.squared_radius[there]; },
              [&](Vec offset, float there, bool inside) {
                sum.add_by_density(offset, inside, neighbors.squared_radius(), there);
              });
  }
  return outlier ? here + rule.strength * sum.mean() : there;
}

enum class Leaves { all, grown, others };  // where the ball of a point grows, and where none does

template <class Neighbors>
__global__ void __launch_bounds__(kBlock)
    wide_fairing(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings, Leaves leaves,
                 Normals normals, AreaWeights areas, FairingRule rule, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const bool valid = tree.holds(at);
  if (leaves != Leaves::all) {
    const bool grown = __any_sync(kAllLanes, valid && surroundings.balls.squared_growth[at] > 1);
    if (grown != (leaves == Leaves::grown)) return;
  }
  const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
  const Vec normal = normals.at(at);
  const float4 p = tree.points[at];
  const Vec moved = fair_point(neighbors, rule, position_of(p), normal, normals, areas, valid);
  store_faired(faired, at, p, valid, moved);
}

template <class Neighbors>
__global__ void __launch_bounds__(kBlock)
    survey_neighbors(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings,
                     const float* values, float* counts, float* least) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const Neighbors neighbors(tree, surroundings, Index(at), tree.holds(at), shared[threadIdx.x / kWarp]);
  float count = 0, lowest = values[at];
  neighbors([&](Index there) { return values[there]; },
            [&](Vec, float value, bool inside) {
              count += inside ? 1.0f : 0.0f;
              lowest = fminf(lowest, inside ? value : lowest);
            });
  counts[at] = count;
  least[at] = lowest;
}

}  // namespace

void survey(Context& context, const Tree& tree, Surroundings surroundings, const float* values, float* counts,
            float* least) {
  const auto kernel = surroundings.lists.k > 0                  ? survey_neighbors<Listed>
                      : surroundings.collected.parts != nullptr ? survey_neighbors<CollectedBall>
                                                                : survey_neighbors<WalkedBall>;
  kernel<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, values, counts, least);
  check(cudaGetLastError(), "looking at neighbourhoods");
}

void measure_radii(Context& context, const Tree& tree, Lists nearest, float squared_base, float* squared_radius) {
  radii<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, nearest, squared_base, squared_radius);
  check(cudaGetLastError(), "measuring radii");
}

void estimate_wide_normals(Context& context, const Tree& tree, CloudState* state, Surroundings surroundings,
                           NormalRule rule, Normals normals) {
  const auto kernel = surroundings.lists.k > 0                  ? wide_normals<Listed>
                      : surroundings.collected.parts != nullptr ? wide_normals<CollectedBall>
                                                                : wide_normals<WalkedBall>;
  kernel<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, state, surroundings, rule, normals);
  check(cudaGetLastError(), "estimating normals");
}

void filter_normals(Context& context, const Tree& tree, Surroundings surroundings, NormalRule rule, float inverse_turn,
                    Normals from, Normals to, GrowthOut growth) {
  const auto kernel = surroundings.lists.k > 0                  ? filtered_normals<Listed>
                      : surroundings.collected.parts != nullptr ? filtered_normals<CollectedBall>
                                                                : filtered_normals<WalkedBall>;
  kernel<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, rule, inverse_turn, from,
                                                                           to, growth);
  check(cudaGetLastError(), "filtering normals");
}

void fair_widely(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                 FairingRule rule, FairedPoints faired) {
  const auto launch = [&](auto kernel, Leaves leaves) {
    kernel<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, leaves, normals, areas,
                                                                             rule, faired);
  };
  if (surroundings.lists.k > 0) {
    launch(wide_fairing<Listed>, Leaves::all);
  } else if (surroundings.collected.parts == nullptr) {
    launch(wide_fairing<WalkedBall>, Leaves::all);
  } else if (surroundings.balls.squared_growth == nullptr) {
    launch(wide_fairing<CollectedBall>, Leaves::all);
  } else {
    launch(wide_fairing<CollectedBall>, Leaves::others);
    launch(wide_fairing<WalkedBall>, Leaves::grown);
  }
  check(cudaGetLastError(), "fairing");
  bring_into_order(context, faired);
}

}  // namespace pointfair::cuda
