// SPDX-License-Identifier: Apache-2.0
// The nearest points of one place. The search of whole leaves (src/cpu/search.h) keeps its lists sorted; here
// candidates are only collected, and cut to the nearest whenever there are twice as many, which suits long lists.
#pragma once

#include <vector>

#include "cpu/kernels.h"

namespace pointfair::cpu {

class SingleSearch {
 public:
  // The k nearest other points of the one at sorted position `at` within `squared_limit`: out[slot], nearest first,
  // ties by original index, kNoNeighbor at the end. O(log N + k log k).
  void find(const IndexView& index, Index at, int k, float squared_limit, Index* out);

 private:
  struct Candidate {
    unsigned long long key;  // point::neighbor_key
    Index position;
    bool operator<(const Candidate& other) const { return key < other.key; }
  };

  void visit_children(int level, Index group_number, Index skipped);
  void visit_leaf(Index leaf);
  void keep_nearest();

  const IndexView* index_ = nullptr;
  Index at_ = 0;
  point::Vec3<float> here_{};
  std::size_t k_ = 0;
  unsigned long long last_ = 0;  // candidates join below this key
  std::vector<Candidate> found_;
};

}  // namespace pointfair::cpu
