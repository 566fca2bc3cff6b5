// SPDX-License-Identifier: Apache-2.0
// Which results of a chain would be the same if points beyond a region were loaded too.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cpu/chain.h"
#include "cpu/parallel.h"
#include "seam/noise_levels.hpp"

namespace pointfair::cpu {
namespace {

constexpr std::size_t kLeavesAtOnce = 64;

template <class View>
point::Vec3<float> vector_at(const View& view, std::size_t at) {
  return {view.x[at], view.y[at], view.z[at]};
}

template <class Body>
void for_points(const IndexView& index, const Body& body) {
  for_blocks(index.leaves, kLeavesAtOnce, {}, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t i = first * kLeafSize; i < std::min<std::size_t>(last * kLeafSize, index.points); ++i) body(i);
  });
}

float one_if(bool is_exact) { return is_exact ? 1.0f : 0.0f; }

// The entries of one point's list.
struct Entries {
  int count = 0;
  float squared_last = 0;
};
Entries entries_of(const IndexView& index, const NeighborView& lists, std::size_t at) {
  const Index* list = lists.list + (at / kLeafSize * std::size_t(lists.stored)) * kLeafSize + at % kLeafSize;
  Entries entries;
  while (entries.count < lists.k && list[std::size_t(entries.count) * kLeafSize] != point::kNoNeighbor) ++entries.count;
  if (entries.count > 0)
    entries.squared_last = point::squared_length(vector_at(index, list[std::size_t(entries.count - 1) * kLeafSize]) -
                                                 vector_at(index, at));
  return entries;
}

// How deep in the region the points lie. Most need no survey: where a neighbourhood ends deeper than the deepest value
// of 0, all values in it are 1 (docs/decisions/039).
class Depths {
 public:
  Depths(const IndexView& index, const point::Region& region)
      : index_(index), region_(region), ends_(index.leaves, kInfinity) {}

  // Adds point i with its reach. A leaf with a point whose neighbours must be counted is surveyed in any case.
  void include(std::size_t i, float squared_gap, float squared_reach, bool must_count) {
    const float end = kLess * std::sqrt(squared_gap) - kMore * std::sqrt(squared_reach);
    const bool is_known = !must_count && squared_gap > kLeast && end > -kInfinity;
    float& least = ends_[i / kLeafSize];
    least = std::min(least, is_known ? end : -kInfinity);
  }
  float deepest_zero(const std::vector<float>& values) const {
    std::vector<float> deepest(index_.leaves, -kInfinity);
    for_points(index_, [&](std::size_t i) {
      if (values[i] == 0)
        deepest[i / kLeafSize] =
            std::max(deepest[i / kLeafSize], std::sqrt(point::squared_gap_to_outside(region_, vector_at(index_, i))));
    });
    return deepest.empty() ? -kInfinity : *std::ranges::max_element(deepest);
  }
  bool ends_deeper(std::size_t leaf, float depth) const { return ends_[leaf] > depth; }

 private:
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  static constexpr float kLess = 1 - 1e-5f, kMore = 1 + 1e-5f;  // distances are rounded
  static constexpr float kLeast = 1e-30f;                       // below, squares have few bits
  const IndexView& index_;
  const point::Region& region_;
  std::vector<float> ends_;  // of each leaf
};

}  // namespace

void Chain::outcomes(const point::Region& loaded, const Kernels& kernels, std::span<unsigned char> out) const {
  const IndexView index = index_.view();
  const std::size_t places = std::size_t(index.leaves) * kLeafSize;
  const float limit =
      neighbors_.radius > 0 ? neighbors_.radius * neighbors_.radius : std::numeric_limits<float>::infinity();
  const point::ListRule rule{neighbors_.k, limit, neighbors_.constraint, neighbors_.reach};
  const bool radius_found = neighbors_.min_neighbors == 0 || index.points > Index(neighbors_.min_neighbors);
  const bool mean_found = index.points > Index(point::kAreaNeighbors);
  const NeighborView lists = neighborhoods().lists;
  const bool with_areas = fairing_settings_.area_weight != AreaWeight::none;
  const point::NodeField reach = field_of(neighbors_.reach_levels.get());

  // 1 or 0 for exact or not: neighbourhoods, then what is made of them
  std::vector<float> neighborhood(places, 1.0f), mean(with_areas ? places : 0, 1.0f), counts(places, 0.0f);
  std::vector<unsigned char> is_short(places, 0);
  Depths depths(index, loaded);
  for_points(index, [&](std::size_t i) {
    const float gap = point::squared_gap_to_outside(loaded, vector_at(index, i));
    const bool has_normal = point::squared_length(vector_at(normals(), i)) > 0;
    if (neighbors_.mesh) {  // of which all is loaded
      depths.include(i, gap, 0, !has_normal);
    } else if (by_list()) {
      const Entries entries = entries_of(index, lists, i);
      neighborhood[i] = one_if(point::is_exact_list(rule, entries.count, entries.squared_last, gap));
      is_short[i] = neighbors_.constraint && entries.count < neighbors_.k;
      depths.include(i, gap, entries.squared_last, !has_normal);
    } else {
      const float squared_radius = squared_radius_[i] * (radii_grow() ? squared_growth_[i] : 1.0f);
      const float looked_at = point::squared_search(squared_radius_[i], point::node_value(reach, vector_at(index, i)));
      neighborhood[i] = one_if(point::is_exact_radius(std::max(squared_radius, looked_at), radius_found, gap));
      depths.include(i, gap, std::max({squared_radius, squared_radius_[i], 0.0f}), !has_normal);
    }
    if (with_areas)
      mean[i] =
          one_if(point::is_exact_mean(mean_found ? mean_distance_[i] : std::numeric_limits<float>::infinity(), gap));
  });
  const auto least_of = [&](const Neighborhoods& neighborhoods, const std::vector<float>& values) {
    std::vector<float> least(places, 1.0f);
    const float deepest = depths.deepest_zero(values);
    for_items(index.leaves, kLeavesAtOnce, {}, [&](std::size_t leaf) {
      if (!depths.ends_deeper(leaf, deepest))
        kernels.survey(index, Index(leaf), neighborhoods, values.data(), counts.data(), least.data());
    });
    return least;
  };
  std::vector<float> normal = neighborhood, read_there(places, 1.0f);
  for (int round = 0; round < normal_settings_.filter_rounds; ++round) normal = least_of(neighborhoods(), normal);
  for (std::size_t i = 0; i < places; ++i)
    read_there[i] =
        std::min(reads_normals_of_neighbors(fairing_settings_) ? normal[i] : 1.0f, with_areas ? mean[i] : 1.0f);
  std::vector<float> step = least_of(grown_neighborhoods(), read_there);
  if (fairing_settings_.method != Method::bilateral) {  // which read the displacements of their neighbours
    for (std::size_t i = 0; i < places; ++i) step[i] = std::min(step[i], neighborhood[i]);
    step = least_of(neighborhoods(), step);
  }

  std::ranges::fill(out, static_cast<unsigned char>(0));
  for_points(index, [&](std::size_t i) {
    const bool exact = neighborhood[i] * normal[i] * step[i] > 0;
    out[index.original[i]] = point::outcome_of(exact, is_short[i] != 0, counts[i], vector_at(normals(), i));
  });
}

}  // namespace pointfair::cpu
