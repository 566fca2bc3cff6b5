// SPDX-License-Identifier: Apache-2.0
// The nearest points of one place. The search of whole leaves (src/cpu/search.h) keeps its lists sorted; here
// candidates are only collected, and cut to the nearest whenever there are twice as many, which suits long lists.
#pragma once

#include <cstdint>
#include <vector>

#include "cpu/kernels.h"

namespace pointfair::cpu {

class SingleSearch {
 public:
  explicit SingleSearch(const Kernels& kernels) : kernels_(kernels) {}

  // The k nearest other points of the one at sorted position `at` within `squared_limit`: out[slot], nearest first,
  // in the order of point::precedes, kNoNeighbor at the end. O(log N + k log k).
  void find(const IndexView& index, Index at, int k, float squared_limit, Index* out);

 private:
  using Key = unsigned long long;  // point::neighbor_key

  static std::uint32_t distance_bits(Key key) { return std::uint32_t(key >> 32); }
  bool precedes(Key a, Key b) const;
  bool may_hold_neighbors(float gap, point::Vec3<float> corner) const;
  void visit_children(int level, Index group_number, Index skipped);
  void visit_leaf(Index leaf);
  void prefetch_children(int level, Index group_number, unsigned children) const;
  void keep_nearest();
  void order_ties();

  const Kernels& kernels_;
  const IndexView* index_ = nullptr;
  Index at_ = 0;
  point::Vec3<float> here_{};
  std::size_t k_ = 0;
  Key last_ = 0;  // candidates that precede it join
  std::vector<Key> found_;
};

}  // namespace pointfair::cpu
