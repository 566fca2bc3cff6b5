// SPDX-License-Identifier: Apache-2.0
// A thread a point, in sorted order, a warp a leaf, over the neighbours of src/cuda/stages/surroundings.cuh.
#include "cuda/stages/faired_points.cuh"
#include "cuda/stages/wide_stages.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

__device__ bool is_crowded(const Tree& tree, Index at) {
  const LeafRange leaves = tree.leaves_beside(at / kLeafSize);
  const Vec here = position_of(tree.points[at]);
  return point::is_crowded(at, leaves.begin * kLeafSize, leaves.end * kLeafSize, [&](Index i) {
    const Vec there = position_of(tree.points[i]);
    return there.x == here.x && there.y == here.y && there.z == here.z;
  });
}

__global__ void __launch_bounds__(kBlock)
    radii(const __grid_constant__ Tree tree, Lists nearest, point::Radii radii, point::NodeField reach_levels,
          float* squared_radius, float* further_share) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const Vec here = position_of(tree.points[at]);
  const auto farthest_of = [&](int count) {
    for (int i = count - 1; i >= 0; --i) {
      const Index neighbor = nearest.of(at)[i * kWarp];
      if (neighbor != point::kNoNeighbor) return point::squared_length(position_of(tree.points[neighbor]) - here);
    }
    return 0.0f;
  };
  const CloudSettings* const of_cloud = tree.settings_over(static_cast<Index>(at / kLeafSize));
  const point::Radii its = radii_of(of_cloud, radii);
  const float reach_level = point::node_value(of_cloud == nullptr ? reach_levels : of_cloud->reach_levels, here);
  if (further_share != nullptr) further_share[at] = point::further_share(reach_level * reach_level);
  const int all = its.min_neighbors, least = all < point::kLeastReached ? all : point::kLeastReached;
  const float squared_reach = farthest_of(all);
  float result = point::squared_radius(squared_reach, farthest_of(least), reach_level * reach_level,
                                       value_or_one(its.squared_level, at) * its.squared_base, its.squared_widest);
  if (squared_reach == 0 && tree.holds(at) && is_crowded(tree, Index(at))) result = point::kNoSquaredRadius;
  squared_radius[at] = result;
}

__global__ void __launch_bounds__(kBlock)
    levels(const __grid_constant__ Tree tree, point::NodeField field, float* squared_level) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const CloudSettings* const its = tree.settings_over(static_cast<Index>(at / kLeafSize));
  const float level = point::node_value(its == nullptr ? field : its->noise_levels, position_of(tree.points[at]));
  squared_level[at] = level * level;
}

template <class Neighbors>
__global__ void __launch_bounds__(kBlock)
    wide_normals(const __grid_constant__ Tree tree, CloudState* state, Surroundings surroundings,
                 point::NormalSettings settings, Normals normals) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const bool valid = tree.holds(at);
  const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
  if (const CloudSettings* const its = tree.settings_over(Index(at / kLeafSize)); its != nullptr)
    settings = its->normals;
  const auto normal = point::normal_of(neighbors, point::weights_of(settings, neighbors));
  normals.set(at, valid ? normal.unit : Vec{});
  count_unmoved(state, valid, normal);
}

template <class Neighbors, bool kGrows>
__global__ void __launch_bounds__(kBlock)
    filtered_normals(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings,
                     point::NormalSettings settings, Normals from, const float* further_share, Normals to,
                     float* squared_growth) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const Neighbors neighbors(tree, surroundings, Index(at), tree.holds(at), shared[threadIdx.x / kWarp]);
  const CloudSettings* const its = tree.settings_over(Index(at / kLeafSize));
  if (its != nullptr) settings = its->normals;
  const point::OwnNormal<float> own{from.at(at), value_or_one(further_share, at)};
  const auto filtered = point::filtered_normal_of<kGrows>(neighbors, settings, own, from,
                                                          radii_of(its, surroundings.radii).squared_widest);
  if constexpr (kGrows) squared_growth[at] = filtered.squared_growth;
  to.set(at, filtered.unit);
}

enum class Leaves { all, grown, others };  // where the radius of a point grows, and where none does

// The settings of a point's cloud.
struct OfAll {
  point::FairingSettings settings;
  __device__ __forceinline__ const point::FairingSettings& of(const Tree&, Index) const { return settings; }
};
struct OfItsCloud {
  bool is_further;
  __device__ __forceinline__ point::FairingSettings of(const Tree& tree, Index leaf) const {
    point::FairingSettings its = tree.settings_over(leaf)->fairing;
    its.is_further = is_further;
    return its;
  }
};

template <class Neighbors, bool kSeeksOutliers, bool kShares, bool kSees, class FairingOf>
__global__ void __launch_bounds__(kBlock)
    wide_fairing(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings, Leaves leaves,
                 Normals normals, AreaWeights areas, const FairingOf fairing, point::Sensors sensors,
                 point::Levels levels, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ typename Neighbors::Shared shared[kWarps];
  const bool valid = tree.holds(at);
  if (leaves != Leaves::all) {
    const bool grown = __any_sync(kAllLanes, valid && surroundings.radii.squared_growth[at] > 1);
    if (grown != (leaves == Leaves::grown)) return;
  }
  const Neighbors neighbors(tree, surroundings, Index(at), valid, shared[threadIdx.x / kWarp]);
  const float4 p = tree.points[at];
  const auto& settings = fairing.of(tree, Index(at / kLeafSize));
  point::OwnPlace<float> own{value_or_one(levels.squared_noise, at),
                             value_or_one(levels.further_share, at),
                             position_of(p),
                             normals.at(at),
                             {}};
  if constexpr (kSees) own.to_sensor = to_sensor(sensors, p, valid);
  const Vec moved = point::faired_point<kSeeksOutliers, kShares, kSees>(neighbors, settings, own, normals, areas,
                                                                        Scalars{surroundings.radii.squared_radius});
  store_faired(faired, at, p, valid, moved);
}

template <class Neighbors>
__global__ void __launch_bounds__(kBlock)
    survey_neighbors(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings,
                     const float* values, float* counts, float* least, SurveyedLeaves leaves) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  if (leaves.ends[at / kLeafSize] > *leaves.deepest_zero) {
    counts[at] = 0;
    least[at] = 1;
    return;
  }
  __shared__ typename Neighbors::Shared shared[kWarps];
  const Neighbors neighbors(tree, surroundings, Index(at), tree.holds(at), shared[threadIdx.x / kWarp]);
  const auto survey = point::survey_of(neighbors, values[at], Scalars{values});
  counts[at] = survey.count;
  least[at] = survey.least;
}

template <class Neighbors, bool kSees, class FairingOf>
auto fairing_by(const point::FairingSettings& settings) {
  const bool shares = settings.shares();
  return settings.seeks_outliers() ? (shares ? wide_fairing<Neighbors, true, true, kSees, FairingOf>
                                             : wide_fairing<Neighbors, true, false, kSees, FairingOf>)
                                   : (shares ? wide_fairing<Neighbors, false, true, kSees, FairingOf>
                                             : wide_fairing<Neighbors, false, false, kSees, FairingOf>);
}

// `settings`: of all clouds, or of any where they switch the same things on.
template <class FairingOf>
void launch_fairing(Context& context, const Tree& tree, const Surroundings& surroundings, Normals normals,
                    AreaWeights areas, const point::FairingSettings& settings, const FairingOf& fairing,
                    const point::Sensors& sensors, point::Levels levels, const FairedPoints& faired) {
  const auto launch = [&]<class Neighbors>(By<Neighbors>, Leaves leaves) {
    auto fair_points = fairing_by<Neighbors, false, FairingOf>(settings);
    if constexpr (std::is_same_v<FairingOf, OfAll>)  // of many clouds no sensor is known
      if (settings.reads_sensor()) fair_points = fairing_by<Neighbors, true, FairingOf>(settings);
    fair_points<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(
        tree, surroundings, leaves, normals, areas, fairing, sensors, levels, faired);
  };
  if (surroundings.collected.parts != nullptr && surroundings.radii.squared_growth != nullptr &&
      !surroundings.along_mesh) {
    launch(By<CollectedRadius>{}, Leaves::others);
    launch(By<WalkedRadius>{}, Leaves::grown);
  } else if constexpr (std::is_same_v<FairingOf, OfItsCloud>) {
    for_radius(surroundings, [&](auto way) { launch(way, Leaves::all); });
  } else {
    for_way(surroundings, [&](auto way) { launch(way, Leaves::all); });
  }
  check(cudaGetLastError(), "fairing");
}

}  // namespace

void survey(Context& context, const Tree& tree, Surroundings surroundings, const float* values, float* counts,
            float* least, SurveyedLeaves leaves) {
  for_way(surroundings, [&]<class Neighbors>(By<Neighbors>) {
    survey_neighbors<Neighbors><<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(
        tree, surroundings, values, counts, least, leaves);
  });
  check(cudaGetLastError(), "looking at neighbourhoods");
}

void measure_levels(Context& context, const Tree& tree, point::NodeField field, float* squared_level) {
  launch(context, "measuring levels of noise", levels, blocks_for(tree.leaves, kWarps), kBlock, tree, field,
         squared_level);
}

void measure_radii(Context& context, const Tree& tree, Lists nearest, const point::Radii& of,
                   point::NodeField reach_levels, float* squared_radius, float* further_share) {
  launch(context, "measuring radii", radii, blocks_for(tree.leaves, kWarps), kBlock, tree, nearest, of, reach_levels,
         squared_radius, further_share);
}

void estimate_wide_normals(Context& context, const Tree& tree, CloudState* state, Surroundings surroundings,
                           const point::NormalSettings& settings, Normals normals) {
  for_way(surroundings, [&]<class Neighbors>(By<Neighbors>) {
    wide_normals<Neighbors><<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, state, surroundings,
                                                                                              settings, normals);
  });
  check(cudaGetLastError(), "estimating normals");
}

void filter_normals(Context& context, const Tree& tree, Surroundings surroundings,
                    const point::NormalSettings& settings, Normals from, const float* further_share, Normals to,
                    float* squared_growth) {
  for_way(surroundings, [&]<class Neighbors>(By<Neighbors>) {
    const auto filter =
        squared_growth == nullptr ? filtered_normals<Neighbors, false> : filtered_normals<Neighbors, true>;
    filter<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context.stream()>>>(tree, surroundings, settings, from,
                                                                             further_share, to, squared_growth);
  });
  check(cudaGetLastError(), "filtering normals");
}

void fair_widely(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                 const point::FairingSettings& settings, const point::Sensors& sensors, point::Levels levels,
                 FairedPoints faired) {
  if (tree.settings != nullptr) {
    launch_fairing(context, tree, surroundings, normals, areas, settings, OfItsCloud{settings.is_further}, sensors,
                   levels, faired);
  } else {
    launch_fairing(context, tree, surroundings, normals, areas, settings, OfAll{settings}, sensors, levels, faired);
  }
  bring_into_order(context, faired);
}

}  // namespace pointfair::cuda
