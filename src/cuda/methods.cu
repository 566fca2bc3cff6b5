// SPDX-License-Identifier: Apache-2.0
// A thread a point, in sorted order, a warp a leaf, in two rounds over the neighbours as in src/cpu/method_loops.h.
#include "cuda/methods.cuh"
#include "cuda/stage_parts.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

using point::Adjustment, point::Displacement, point::MethodRule;
using Weights = point::LocalBilateralWeights<float>;

// What the sums read of a neighbour beside its place: its normal or displacement, and its area's weight.
struct __align__(16) Carried {
  Vec vector;
  float area;
};

// The weighted mean of the neighbours' offsets.
template <class Neighbors>
__device__ __forceinline__ Vec mean_offset(const Neighbors& neighbors, Weights weights, AreaWeights areas) {
  point::NeighborMean<float> sum;
  neighbors([&](Index there) { return areas.of(there); },
            [&](Vec offset, float area, bool inside) { sum.add(offset, offset, area, inside, weights); });
  return sum.mean();
}

template <class Neighbors>
__device__ __forceinline__ Vec to_quadric(const Neighbors& neighbors, Weights weights, Vec normal, float own_area,
                                          AreaWeights areas) {
  const float mean_height = dot(normal, mean_offset(neighbors, weights, areas));
  point::QuadricFit<float> fit(normal, mean_height, own_area, weights);
  neighbors([&](Index there) { return areas.of(there); },
            [&](Vec offset, float area, bool inside) { fit.add(offset, area, inside, weights); });
  return fit.height() * normal;
}

template <class Neighbors>
__device__ __forceinline__ Vec to_planes(const Neighbors& neighbors, Weights weights, Normals normals,
                                         AreaWeights areas) {
  point::PredictorMean<float> sum;
  neighbors(
      [&](Index there) {
        return Carried{normals.at(there), areas.of(there)};
      },
      [&](Vec offset, Carried there, bool inside) { sum.add(offset, there.vector, there.area, inside, weights); });
  return sum.mean();
}

template <class Neighbors, Displacement kTo>
__global__ void __launch_bounds__(kBlock)
    displace(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings, Normals normals,
             AreaWeights areas, MethodRule rule, Normals displacements) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const bool valid = tree.holds(at);
  const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
  const Weights weights = point::weights_of(rule, neighbors.squared_radius());
  Vec d;
  if constexpr (kTo == Displacement::to_quadric) {
    d = to_quadric(neighbors, weights, normals.at(at), valid ? areas.of(Index(at)) : 0.0f, areas);
  } else if constexpr (kTo == Displacement::to_planes) {
    d = to_planes(neighbors, weights, normals, areas);
  } else {
    d = mean_offset(neighbors, weights, areas);
    if constexpr (kTo == Displacement::to_plane) d = dot(normals.at(at), d) * normals.at(at);
  }
  displacements.set(at, rule.strength * d);
}

template <class Neighbors>
__device__ __forceinline__ Vec relaxed(const Neighbors& neighbors, Weights weights, point::Relaxation relaxation,
                                       Vec own, Normals displacements, AreaWeights areas) {
  point::NeighborMean<float> sum;
  neighbors(
      [&](Index there) {
        return Carried{displacements.at(there), areas.of(there)};
      },
      [&](Vec offset, Carried there, bool inside) { sum.add(there.vector, offset, there.area, inside, weights); });
  return relaxation.own * own + relaxation.mean * sum.mean();
}

template <class Neighbors>
__device__ __forceinline__ Vec shrunk(const Neighbors& neighbors, Weights weights, const MethodRule& rule, Vec own,
                                      float own_area, Normals displacements, AreaWeights areas) {
  point::WienerShrinkage<float> sum(own, own_area, weights);
  neighbors(
      [&](Index there) {
        return Carried{displacements.at(there), areas.of(there)};
      },
      [&](Vec offset, Carried there, bool inside) { sum.add(there.vector, offset, there.area, inside, weights); });
  return (rule.relaxation.own * sum.share(rule.noise_variance)) * own;
}

template <class Neighbors, Adjustment kBy>
__global__ void __launch_bounds__(kBlock)
    move(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings, Normals displacements,
         AreaWeights areas, MethodRule rule, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const bool valid = tree.holds(at);
  Vec d = displacements.at(at);
  if constexpr (kBy != Adjustment::none) {
    __shared__ typename Neighbors::Shared shared[kWarps];
    const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
    const Weights weights = point::weights_of(rule, neighbors.squared_radius());
    if constexpr (kBy == Adjustment::relaxation) {
      d = relaxed(neighbors, weights, rule.relaxation, d, displacements, areas);
    } else {
      d = shrunk(neighbors, weights, rule, d, valid ? areas.of(Index(at)) : 0.0f, displacements, areas);
    }
  }
  const float4 p = tree.points[at];
  store_faired(faired, at, p, valid, position_of(p) + d);
}

template <Displacement kTo>
auto displacing(const Surroundings& surroundings) {
  if (surroundings.lists.k > 0) return displace<Listed, kTo>;
  return surroundings.collected.parts != nullptr ? displace<CollectedBall, kTo> : displace<WalkedBall, kTo>;
}
auto displacing(Displacement to, const Surroundings& surroundings) {
  switch (to) {
    case Displacement::to_plane:
      return displacing<Displacement::to_plane>(surroundings);
    case Displacement::to_quadric:
      return displacing<Displacement::to_quadric>(surroundings);
    case Displacement::to_planes:
      return displacing<Displacement::to_planes>(surroundings);
    case Displacement::to_mean:
      break;
  }
  return displacing<Displacement::to_mean>(surroundings);
}

template <Adjustment kBy>
auto moving(const Surroundings& surroundings) {
  if (surroundings.lists.k > 0) return move<Listed, kBy>;
  return surroundings.collected.parts != nullptr ? move<CollectedBall, kBy> : move<WalkedBall, kBy>;
}
auto moving(Adjustment by, const Surroundings& surroundings) {
  if (by == Adjustment::relaxation) return moving<Adjustment::relaxation>(surroundings);
  if (by == Adjustment::wiener) return moving<Adjustment::wiener>(surroundings);
  return move<Listed, Adjustment::none>;
}

}  // namespace

void fair_by_method(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                    const MethodRule& rule, Normals displacements, FairedPoints faired) {
  const auto displace_all = displacing(rule.displacement, surroundings);
  displace_all<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, normals, areas,
                                                                                 rule, displacements);
  check(cudaGetLastError(), "displacing points");
  const auto move_all = moving(rule.adjustment, surroundings);
  move_all<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, displacements, areas,
                                                                             rule, faired);
  check(cudaGetLastError(), "fairing");
  bring_into_order(context, faired);
}

}  // namespace pointfair::cuda
