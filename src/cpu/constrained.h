// SPDX-License-Identifier: Apache-2.0
// Constrained neighbourhoods of the points of a leaf: grow_constrained (src/point/neighbors.h) over as many of the
// nearest points as it takes.
#pragma once

#include <vector>

#include "cpu/kernels.h"
#include "cpu/single_search.h"
#include "seam/settings.hpp"

namespace pointfair::cpu {

// Serves one thread; holds its working memory.
class ConstrainedSearch {
 public:
  ConstrainedSearch(const Kernels& kernels, const NeighborSettings& settings, float squared_limit);

  // Fills the k slots of the leaf's 16 points: list[slot * 16 + lane].
  // Returns the plain nearest points of each within the limit, at least 16, in the same layout, valid until the next
  // call.
  const Index* find(const IndexView& index, Index leaf, Index* list);

 private:
  bool grow(const IndexView& index, Index position, int count, Index* list);

  const Kernels& kernels_;
  NeighborSettings settings_;
  float squared_limit_;
  int first_pool_;                      // candidates fetched for a whole leaf at once
  std::vector<Index> candidates_;       // of the leaf's 16 points
  std::vector<Index> more_candidates_;  // of one point whose first pool did not suffice
  std::vector<point::Vec3<float>> members_;
  SingleSearch single_;
};

}  // namespace pointfair::cpu
