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

}  // namespace

Chain::Chain(MemoryMeter& meter)
    : index_(meter),
      lists_(meter),
      mean_distance_(meter),
      normal_x_(meter),
      normal_y_(meter),
      normal_z_(meter),
      faired_(meter) {}

void Chain::build_index(std::span<const Point> points, std::span<const Index> originals, SortSpace& space,
                        const Kernels& kernels, const std::stop_token& stop) {
  has_lists_ = false;
  index_.build(points, originals, space, kernels, stop);
  counts_ = {};
  counts_.unmoved.non_finite = index_.invalid().size();
}

void Chain::release_small_results() {
  for (Buffer<float>* values : {&mean_distance_, &normal_x_, &normal_y_, &normal_z_}) values->release();
}

bool Chain::prefix_suffices(const NeighborSettings& settings) const {
  NeighborSettings longer = settings;
  longer.k = neighbors_.k;
  return has_lists_ && settings.k > 0 && settings.k <= stored_k_ && longer == neighbors_;
}

// Neighbourhoods of fewer than k, where the constraint may have cut them.
void Chain::count_short(const std::stop_token& stop) {
  counts_.short_neighborhoods = 0;
  if (!neighbors_.constraint) return;
  const IndexView index = index_.view();
  std::atomic<std::uint64_t> total = 0;
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    std::uint64_t here = 0;
    for (std::size_t i = first * kLeafSize; i < std::min<std::size_t>(last * kLeafSize, index.points); ++i) {
      const std::size_t last_slot = i / kLeafSize * stored_k_ + std::size_t(neighbors_.k) - 1;
      here += lists_[last_slot * kLeafSize + i % kLeafSize] == point::kNoNeighbor;
    }
    total += here;
  });
  counts_.short_neighborhoods = total;
}

void Chain::find_neighbors(const NeighborSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  if (prefix_suffices(settings)) {
    neighbors_ = settings;
    return count_short(stop);
  }
  has_lists_ = false;
  neighbors_ = settings;
  stored_k_ = settings.k;
  const IndexView index = index_.view();
  const std::size_t row = std::size_t(settings.k) * kLeafSize;
  lists_.resize(index.leaves * row);
  mean_distance_.resize(std::size_t(index.leaves) * kLeafSize);
  const float limit = settings.radius > 0 ? settings.radius * settings.radius : std::numeric_limits<float>::infinity();
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    ConstrainedSearch constrained(kernels, settings, limit);
    Index area_list[point::kAreaNeighbors * kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      Index* list = lists_.data() + leaf * row;
      const Index* nearest = list;
      int nearest_count = settings.k;
      if (settings.constraint) {
        nearest = constrained.find(index, Index(leaf), list);
        nearest_count = point::kAreaNeighbors;
      } else if (settings.k > 0) {
        kernels.nearest(index, Index(leaf), settings.k, limit, list);
      }
      if (nearest_count < point::kAreaNeighbors || settings.radius > 0) {  // W_a knows no radius
        kernels.nearest(index, Index(leaf), point::kAreaNeighbors, std::numeric_limits<float>::infinity(), area_list);
        nearest = area_list;
      }
      kernels.mean_distances(index, Index(leaf), nearest, point::kAreaNeighbors,
                             mean_distance_.data() + leaf * kLeafSize);
    }
  });
  count_short(stop);
  has_lists_ = true;
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
      const Index* list = lists_.data() + leaf * stored_k_ * kLeafSize;
      if (by_list()) {
        kernels.normals(index, Index(leaf), lists(), weights, out);
      } else {
        kernels.normals_in_ball(index, Index(leaf), ball(), weights, out, found);
      }
      const Index points = std::min<Index>(kLeafSize, index.points - Index(leaf) * kLeafSize);
      for (Index lane = 0; lane < points; ++lane) {
        constexpr Index kNeeded = point::kLeastNeighbors;
        const bool enough =
            by_list() ? neighbors_.k >= int(kNeeded) && list[(kNeeded - 1) * kLeafSize + lane] != point::kNoNeighbor
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
  const int power = settings.area_weight == AreaWeight::squared  ? 2
                    : settings.area_weight == AreaWeight::length ? 1
                                                                 : 0;
  const AreaView area{mean_distance_.data(), power};
  faired_.resize(std::size_t(index.leaves) * kLeafSize);
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      float* xyz = &faired_[leaf * kLeafSize].x;
      if (by_list()) {
        kernels.fair(index, Index(leaf), lists(), normals(), area, weights, xyz);
      } else {
        kernels.fair_in_ball(index, Index(leaf), ball(), normals(), area, weights, xyz);
      }
    }
  });
}

}  // namespace pointfair::cpu
