// SPDX-License-Identifier: Apache-2.0
#include "cpu/chain.h"

#include <atomic>
#include <limits>
#include <vector>

#include "cpu/constrained.h"
#include "cpu/parallel.h"

namespace pointfair::cpu {
namespace {

constexpr std::size_t kLeavesABlock = 64;

// The area weight's neighbours, found beside the lists where those are too short or too narrow to hold them.
bool lists_hold_area_neighbors(const NeighborSettings& settings) {
  return settings.k >= point::kAreaNeighbors && settings.radius == 0 && !settings.constraint;
}

}  // namespace

Chain::Chain(MemoryMeter& meter)
    : index_(meter), lists_(meter), mean_distance_(meter), normal_x_(meter), normal_y_(meter), normal_z_(meter),
      faired_(meter) {}

void Chain::build_index(std::span<const Point> points, std::span<const Index> originals, const Kernels& kernels,
                        const std::stop_token& stop) {
  index_.build(points, originals, kernels, stop);
  counts_ = {};
  counts_.unmoved.non_finite = index_.invalid().size();
}

void Chain::find_neighbors(const NeighborSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  neighbors_ = settings;
  const IndexView index = index_.view();
  const std::size_t row = std::size_t(settings.k) * kLeafSize;
  lists_.resize(index.leaves * row);
  mean_distance_.resize(std::size_t(index.leaves) * kLeafSize);
  const float limit = settings.radius > 0 ? settings.radius * settings.radius : std::numeric_limits<float>::infinity();
  std::atomic<std::uint64_t> short_neighborhoods = 0;
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    ConstrainedSearch constrained(kernels, settings, limit);
    Index area_list[point::kAreaNeighbors * kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      Index* list = lists_.data() + leaf * row;
      if (settings.constraint) {
        constrained.find(index, Index(leaf), list);
      } else if (settings.k > 0) {
        kernels.nearest(index, Index(leaf), settings.k, limit, list);
      }
      const Index* nearest = list;
      if (!lists_hold_area_neighbors(settings)) {
        kernels.nearest(index, Index(leaf), point::kAreaNeighbors, std::numeric_limits<float>::infinity(), area_list);
        nearest = area_list;
      }
      kernels.mean_distances(index, Index(leaf), nearest, point::kAreaNeighbors, mean_distance_.data() + leaf * kLeafSize);
    }
    short_neighborhoods += constrained.short_neighborhoods();
  });
  counts_.short_neighborhoods = short_neighborhoods;
}

void Chain::estimate_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  const IndexView index = index_.view();
  const point::NormalWeights weights = point::normal_weights(settings.weighted, settings.sigma);
  for (Buffer<float>* axis : {&normal_x_, &normal_y_, &normal_z_}) axis->resize(std::size_t(index.leaves) * kLeafSize);
  const NormalsOut out{normal_x_.data(), normal_y_.data(), normal_z_.data()};
  std::atomic<std::uint64_t> too_few = 0, no_normal = 0;
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    std::uint64_t too_few_here = 0, no_normal_here = 0;
    unsigned found[kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      const Index* list = lists_.data() + leaf * neighbors_.k * kLeafSize;
      if (has_lists()) {
        kernels.normals(index, Index(leaf), lists(), weights, out);
      } else {
        kernels.normals_in_ball(index, Index(leaf), ball(), weights, out, found);
      }
      const Index points = std::min<Index>(kLeafSize, index.points - Index(leaf) * kLeafSize);
      for (Index lane = 0; lane < points; ++lane) {
        constexpr Index kNeeded = point::kLeastNeighbors;
        const bool enough = has_lists() ? neighbors_.k >= int(kNeeded) &&
                                              list[(kNeeded - 1) * kLeafSize + lane] != point::kNoNeighbor
                                        : found[lane] >= kNeeded;
        const std::size_t i = leaf * kLeafSize + lane;
        if (!enough) {
          ++too_few_here;
        } else if (out.x[i] == 0 && out.y[i] == 0 && out.z[i] == 0) {
          ++no_normal_here;
        }
      }
    }
    too_few += too_few_here;
    no_normal += no_normal_here;
  });
  counts_.unmoved.too_few_neighbors = too_few;
  counts_.unmoved.no_normal = no_normal;
}

void Chain::fair(const FairingSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  const IndexView index = index_.view();
  const point::BilateralWeights weights = point::bilateral_weights(settings.closeness_sigma, settings.similarity_sigma);
  const int power = settings.area_weight == AreaWeight::squared ? 2 : settings.area_weight == AreaWeight::length ? 1 : 0;
  const AreaView area{mean_distance_.data(), power};
  faired_.resize(std::size_t(index.leaves) * kLeafSize);
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      float* xyz = &faired_[leaf * kLeafSize].x;
      if (has_lists()) {
        kernels.fair(index, Index(leaf), lists(), normals(), area, weights, xyz);
      } else {
        kernels.fair_in_ball(index, Index(leaf), ball(), normals(), area, weights, xyz);
      }
    }
  });
}

}  // namespace pointfair::cpu
