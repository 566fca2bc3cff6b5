// SPDX-License-Identifier: Apache-2.0
// Constrained neighbourhoods of the points of a leaf: grow_constrained (src/point/neighbors.h) over as many of the
// nearest points as it takes.
#pragma once

#include <vector>

#include "backend.hpp"
#include "cpu/kernels.h"

namespace pointfair::cpu {

// Serves one thread; holds its working memory.
class ConstrainedSearch {
 public:
  ConstrainedSearch(const Kernels& kernels, const NeighborSettings& settings, float squared_limit);

  // Fills the k slots of the leaf's 16 points: list[slot * 16 + lane].
  void find(const IndexView& index, Index leaf, Index* list);

  // Points so far whose neighbourhood is complete and yet holds fewer than k.
  std::uint64_t short_neighborhoods() const { return short_neighborhoods_; }

 private:
  bool grow(const IndexView& index, Index position, const Index* candidates, int stride, int count, Index* list, int lane);

  const Kernels& kernels_;
  NeighborSettings settings_;
  float squared_limit_;
  int first_pool_;                  // candidates fetched for a whole leaf at once
  std::vector<Index> candidates_;
  std::vector<point::Vec3<float>> members_;
  std::uint64_t short_neighborhoods_ = 0;
};

}  // namespace pointfair::cpu
