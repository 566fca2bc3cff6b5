// SPDX-License-Identifier: Apache-2.0
// The bodies of src/point/method_stages.h: a thread a point, in sorted order, a warp a leaf.
#include "cuda/stages/faired_points.cuh"
#include "cuda/stages/methods.cuh"
#include "point/method_stages.h"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

using point::Adjustment, point::Displacement, point::MethodRule;

template <class Neighbors, Displacement kTo>
__global__ void __launch_bounds__(kBlock)
    displace(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings, Normals normals,
             AreaWeights areas, MethodRule rule, Normals displacements) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const bool valid = tree.holds(at);
  const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
  const point::OwnPlane<float> own{normals.at(at), valid ? areas.of(Index(at)) : 0.0f};
  displacements.set(at, point::displacement_of<kTo>(neighbors, rule, own, normals, areas));
}

template <class Neighbors, Adjustment kBy>
__global__ void __launch_bounds__(kBlock)
    move(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings, Normals displacements,
         AreaWeights areas, MethodRule rule, point::Sensors sensors, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const bool valid = tree.holds(at);
  Vec d = displacements.at(at);
  if constexpr (kBy != Adjustment::none) {
    __shared__ typename Neighbors::Shared shared[kWarps];
    const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
    d = point::adjusted<kBy>(neighbors, rule, d, valid ? areas.of(Index(at)) : 0.0f, displacements, areas);
  }
  const float4 p = tree.points[at];
  if (rule.settings.along_ray) d = point::along_ray(d, to_sensor(sensors, p, valid));
  store_faired(faired, at, p, valid, position_of(p) + d);
}

template <class Neighbors>
auto displacing(Displacement to) {
  switch (to) {
    case Displacement::to_plane:
      return displace<Neighbors, Displacement::to_plane>;
    case Displacement::to_quadric:
      return displace<Neighbors, Displacement::to_quadric>;
    case Displacement::to_planes:
      return displace<Neighbors, Displacement::to_planes>;
    case Displacement::to_mean:
      break;
  }
  return displace<Neighbors, Displacement::to_mean>;
}

template <class Neighbors>
auto moving(Adjustment by) {
  if (by == Adjustment::relaxation) return move<Neighbors, Adjustment::relaxation>;
  if (by == Adjustment::wiener) return move<Neighbors, Adjustment::wiener>;
  return move<Neighbors, Adjustment::none>;
}

}  // namespace

void fair_by_method(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                    const MethodRule& rule, const point::Sensors& sensors, Normals displacements, FairedPoints faired) {
  for_way(surroundings, [&]<class Neighbors>(By<Neighbors>) {
    launch(context, "displacing points", displacing<Neighbors>(rule.displacement), blocks_for(tree.leaves, kWarps),
           kBlock, tree, surroundings, normals, areas, rule, displacements);
    launch(context, "fairing", moving<Neighbors>(rule.adjustment), blocks_for(tree.leaves, kWarps), kBlock, tree,
           surroundings, displacements, areas, rule, sensors, faired);
  });
  bring_into_order(context, faired);
}

}  // namespace pointfair::cuda
