// SPDX-License-Identifier: Apache-2.0
// The chain's neighbourhoods: lists, radii, and the lengths of W_a.
#include <algorithm>
#include <atomic>
#include <limits>
#include <vector>

#include "cpu/chain.h"
#include "cpu/kernels.h"
#include "cpu/parallel.h"
#include "cpu/single_search.h"
#include "seam/noise_levels.hpp"

namespace pointfair::cpu {
namespace {

// Of leaves, where lists are as long as they can be under the constraint, which then takes up to 10 ms a leaf.
constexpr std::size_t kConstrainedLeavesABlock = 2;

// Constrained neighbourhoods of the points of a leaf: grow_constrained (src/point/neighbors.h) over as many of the
// nearest points as it takes. Serves one thread; holds its working memory.
class ConstrainedSearch {
 public:
  ConstrainedSearch(const Kernels& kernels, const NeighborSettings& settings, float squared_limit)
      : kernels_(kernels),
        settings_(settings),
        squared_limit_(squared_limit),
        first_pool_(std::max(16, 2 * settings.k)),
        single_(kernels) {
    if (!settings.constraint) return;
    candidates_.resize(std::size_t(first_pool_) * kLeafSize);
    more_candidates_.resize(kLargestPool);
    members_.resize(std::size_t(settings.k));
  }

  // Fills the k slots of the leaf's 16 points: list[slot * 16 + lane].
  // Returns the plain nearest points of each within the limit, at least 16, in the same layout, valid until the next
  // call.
  const Index* find(const IndexView& index, Index leaf, Index* list) {
    kernels_.nearest(index, leaf, first_pool_, squared_limit_, candidates_.data());
    const unsigned complete =
        kernels_.grow(index, leaf, candidates_.data(), first_pool_, settings_.k, settings_.reach, list);
    const Index first = leaf * kLeafSize;
    for (Index lane = 0; lane < kLeafSize; ++lane) {
      if ((complete >> lane & 1) != 0) continue;
      int pool = first_pool_;
      do {
        pool = std::min(2 * pool, kLargestPool);
        single_.find(index, first + lane, pool, squared_limit_, more_candidates_.data());
      } while (!grow(index, first + lane, pool, list + lane) && pool < kLargestPool);
    }
    return candidates_.data();
  }

 private:
  static constexpr int kLargestPool = 1024;

  // Returns false if candidates beyond those given could still join.
  bool grow(const IndexView& index, Index position, int count, Index* list) {
    const auto end = std::find(more_candidates_.begin(), more_candidates_.begin() + count, point::kNoNeighbor);
    const int given = int(end - more_candidates_.begin());
    const point::Vec3<float> here = {index.x[position], index.y[position], index.z[position]};
    int accepted = 0;
    const auto offset = [&](int i) {
      const Index at = more_candidates_[i];
      return point::Vec3<float>{index.x[at], index.y[at], index.z[at]} - here;
    };
    const auto accept = [&](int i) {
      members_[accepted] = offset(i);
      list[accepted++ * kLeafSize] = more_candidates_[i];
    };
    return point::grow_constrained(given, settings_.k, settings_.reach, given < count, offset, accept,
                                   [&](int i) { return members_[i]; })
        .complete;
  }

  const Kernels& kernels_;
  NeighborSettings settings_;
  float squared_limit_;
  int first_pool_;                      // candidates fetched for a whole leaf at once
  std::vector<Index> candidates_;       // of the leaf's 16 points
  std::vector<Index> more_candidates_;  // of one point whose first pool did not suffice
  std::vector<point::Vec3<float>> members_;
  SingleSearch single_;
};

// Distances of the leaves along the curve, each with the k-th nearest of the leaf before, and a quarter of that more,
// as what is likely.
class DistanceSearch {
 public:
  DistanceSearch(const Kernels& kernels, const IndexView& index, int k)
      : kernels_(kernels), index_(index), k_(k), squared_(std::size_t(k) * kLeafSize) {}
  const float* find(Index leaf) {
    kernels_.nearest_distances(index_, leaf, k_, likely_, squared_.data());
    constexpr float kRoom = 1.25f * 1.25f;
    likely_ = kRoom * *std::max_element(squared_.end() - kLeafSize, squared_.end());
    return squared_.data();
  }

 private:
  const Kernels& kernels_;
  const IndexView& index_;
  int k_;
  float likely_ = std::numeric_limits<float>::infinity();
  std::vector<float> squared_;
};

}  // namespace

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
  if (!by_list() && index_.view().points > 0 && index_.view().share == nullptr)
    throw Error(ErrorKind::failed, "sums over radius neighbourhoods need an index along a frame's curve");
  mesh_lists_.clear();
  lists_.resize(neighbors_.mesh ? 0 : index_.view().leaves * list_row());
  mean_distance_.resize(std::size_t(index_.view().leaves) * kLeafSize);
  measure_levels(kernels, stop);
  if (!by_list()) {
    measure_radii(kernels, stop);
  } else if (!neighbors_.mesh) {
    find_lists(kernels, stop);
  }
  has_areas_ = !by_list() || !neighbors_.mesh;
  if (neighbors_.mesh) mesh_lists_.find(index_.view(), neighbors_, neighborhoods().radii, stop);
  count_short(stop);
  has_lists_ = true;
}

void Chain::find_lists(const Kernels& kernels, const std::stop_token& stop) {
  const IndexView index = index_.view();
  const float limit =
      neighbors_.radius > 0 ? neighbors_.radius * neighbors_.radius : std::numeric_limits<float>::infinity();
  const std::size_t block_size = neighbors_.constraint ? kConstrainedLeavesABlock : kLeavesABlock;
  for_blocks(index.leaves, block_size, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    ConstrainedSearch constrained(kernels, neighbors_, limit);
    float squared[point::kAreaNeighbors * kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      Index* const list = lists_.data() + leaf * list_row();
      const Index* nearest = list;
      int nearest_count = neighbors_.k;
      if (neighbors_.constraint) {
        nearest = constrained.find(index, Index(leaf), list);
        nearest_count = point::kAreaNeighbors;
      } else {
        kernels.nearest(index, Index(leaf), neighbors_.k, limit, list);
      }
      if (nearest_count < point::kAreaNeighbors || neighbors_.radius > 0) {  // W_a knows no radius
        kernels.nearest_distances(index, Index(leaf), point::kAreaNeighbors, std::numeric_limits<float>::infinity(),
                                  squared);
      } else {
        kernels.listed_distances(index, Index(leaf), nearest, point::kAreaNeighbors, squared);
      }
      kernels.mean_distances(squared, point::kAreaNeighbors, mean_distance_.data() + leaf * kLeafSize);
    }
  });
}

// Of W_a, which knows no mesh: along one it is the only reader of what lies nearest.
void Chain::measure_areas(const Kernels& kernels, const std::stop_token& stop) {
  has_areas_ = true;
  const IndexView index = index_.view();
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    DistanceSearch nearest(kernels, index, point::kAreaNeighbors);
    for (std::size_t leaf = first; leaf < last; ++leaf)
      kernels.mean_distances(nearest.find(Index(leaf)), point::kAreaNeighbors,
                             mean_distance_.data() + leaf * kLeafSize);
  });
}

void Chain::measure_levels(const Kernels& kernels, const std::stop_token& stop) {
  if (!neighbors_.levels) return squared_level_.release();
  const IndexView index = index_.view();
  const point::NodeField field = field_of(neighbors_.levels.get());
  squared_level_.resize(std::size_t(index.leaves) * kLeafSize);
  for_items(index.leaves, kLeavesABlock, stop, [&](std::size_t leaf) {
    kernels.squared_levels(index, Index(leaf), field, squared_level_.data() + leaf * kLeafSize);
  });
}

void Chain::measure_radii(const Kernels& kernels, const std::stop_token& stop) {
  const IndexView index = index_.view();
  squared_radius_.resize(std::size_t(index.leaves) * kLeafSize);
  const int count = std::max(neighbors_.min_neighbors, point::kAreaNeighbors);  // of which both take the first ones
  const point::NodeField reach = field_of(neighbors_.reach_levels.get());
  if (reach.values == nullptr) further_share_.release();
  if (reach.values != nullptr) further_share_.resize(squared_radius_.size());
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    DistanceSearch nearest(kernels, index, count);
    float reach_level[kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      const float* const squared = nearest.find(Index(leaf));
      kernels.mean_distances(squared, point::kAreaNeighbors, mean_distance_.data() + leaf * kLeafSize);
      if (reach.values != nullptr) {
        kernels.squared_levels(index, Index(leaf), reach, reach_level);
        std::transform(reach_level, reach_level + kLeafSize, further_share_.data() + leaf * kLeafSize,
                       [](float level) { return point::further_share(level); });
      }
      kernels.squared_radii(index, Index(leaf), squared, neighborhoods().radii,
                            reach.values != nullptr ? reach_level : nullptr, squared_radius_.data() + leaf * kLeafSize);
    }
  });
}

}  // namespace pointfair::cpu
