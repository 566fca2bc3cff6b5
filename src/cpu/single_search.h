// SPDX-License-Identifier: Apache-2.0
// The nearest points of one place. The search of whole leaves (src/cpu/search.h) keeps its lists sorted; here
// candidates are only collected, and cut to the nearest whenever there are twice as many, which suits long lists. Of
// many, both this and the sorting at the end go by buckets of distances: of 1,024 neighbours, a sort alone took a third
// of a search.
#pragma once

#include <array>
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
  void count_in_buckets();
  std::size_t bucket_of(Key key) const { return std::size_t((distance_bits(key) - nearest_) >> shift_); }
  void keep_nearest();
  void sort_found();
  void order_ties();

  const Kernels& kernels_;
  const IndexView* index_ = nullptr;
  Index at_ = 0;
  point::Vec3<float> here_{};
  std::size_t k_ = 0;
  Key last_ = 0;  // candidates that precede it join
  std::vector<Key> found_, space_;

  // Of what is found, if there is much: how many lie in the buckets before each, by the bits of the distance, from the
  // nearest one on.
  static constexpr std::size_t kBuckets = 1024, kMany = 128;
  std::uint32_t nearest_ = 0;  // bits
  int shift_ = 0;
  std::array<std::uint32_t, kBuckets + 1> before_{};
};

}  // namespace pointfair::cpu
