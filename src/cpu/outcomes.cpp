// SPDX-License-Identifier: Apache-2.0
// Which results of a chain would be the same if points beyond a region were loaded too.
#include <limits>
#include <vector>

#include "cpu/chain.h"
#include "cpu/parallel.h"

namespace pointfair::cpu {
namespace {

constexpr std::size_t kLeavesABlock = 64;

template <class View>
point::Vec3<float> vector_at(const View& view, std::size_t at) {
  return {view.x[at], view.y[at], view.z[at]};
}

template <class Body>
void for_points(const IndexView& index, const Body& body) {
  for_blocks(index.leaves, kLeavesABlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t i = first * kLeafSize; i < std::min<std::size_t>(last * kLeafSize, index.points); ++i) body(i);
  });
}

// Of one point's list.
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

  // 1 or 0 for exact or not: neighbourhoods, then what is made of them
  std::vector<float> neighborhood(places, 1.0f), mean(with_areas ? places : 0, 1.0f), counts(places, 0.0f);
  std::vector<unsigned char> is_short(places, 0);
  for_points(index, [&](std::size_t i) {
    const float gap = point::squared_gap_to_outside(loaded, vector_at(index, i));
    if (by_list()) {
      const Entries entries = entries_of(index, lists, i);
      neighborhood[i] = point::is_exact_list(rule, entries.count, entries.squared_last, gap) ? 1.0f : 0.0f;
      is_short[i] = neighbors_.constraint && entries.count < neighbors_.k;
    } else {
      const float squared_radius = squared_radius_[i] * (radii_grow() ? squared_growth_[i] : 1.0f);
      neighborhood[i] = point::is_exact_radius(squared_radius, radius_found, gap) ? 1.0f : 0.0f;
    }
    if (with_areas)
      mean[i] = point::is_exact_mean(mean_found ? mean_distance_[i] : std::numeric_limits<float>::infinity(), gap)
                    ? 1.0f
                    : 0.0f;
  });
  const auto least_of = [&](const Neighborhoods& neighborhoods, const std::vector<float>& values) {
    std::vector<float> least(places, 1.0f);
    for_blocks(index.leaves, kLeavesABlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t leaf = first; leaf < last; ++leaf)
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

  std::fill(out.begin(), out.end(), static_cast<unsigned char>(0));
  for_points(index, [&](std::size_t i) {
    const bool exact = neighborhood[i] * normal[i] * step[i] > 0;
    out[index.original[i]] = point::outcome_of(exact, is_short[i] != 0, counts[i], vector_at(normals(), i));
  });
}

}  // namespace pointfair::cpu
