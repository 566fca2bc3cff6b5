// SPDX-License-Identifier: Apache-2.0
// The k nearest points in one index for the points of another, as src/cpu/search.h finds them within one. Part of
// src/cpu/kernels.cpp.
#pragma once

#include "cpu/search.h"

namespace pointfair::cpu::POINTFAIR_ISA {

struct QueriesThere {
  const IndexView& there;
  Queries queries;
  Index start;  // leaf
  int k;
};

POINTFAIR_INLINE QueriesThere only_lanes(QueriesThere q, Mask active, const IndexView& here, Index first,
                                         const int* own) {
  q.queries = make_queries(here, first, active, broadcast(kInfinity));
  q.queries.at = load(own);
  return q;
}

[[gnu::noinline]] static void search_there_exactly(const QueriesThere& q, Mask active, Index* out) {
  ExactLists lists(q.k);
  constexpr int kNoBudget = 0x7fffffff;
  GroupSearch<ExactLists, true> search(q.there, q.queries, lists, kNoBudget);
  search.run(q.start, 0);
  copy_lists(lists, q.k, active, out);
}

// Lanes [first_lane, last_lane) of the pack at sorted position `first`.
template <int K>
void search_there(const IndexView& here, Index first, const int* own, const QueriesThere& of_all, int first_lane,
                  int last_lane, Index* out) {
  const Mask active = lanes_between(first_lane, last_lane) & (lane_numbers() < broadcast(int(here.points - first)));
  if (!any(active)) return;
  const QueriesThere q = only_lanes(of_all, active, here, first, own);
  FastLists<K> lists(q.k);
  GroupSearch<FastLists<K>, true> search(q.there, q.queries, lists, leaf_budget(q.k));
  const bool is_whole = search.run(q.start, leaves_beside(K)) && !lists.overflown();
  if (is_whole && lists.finish(q.there, q.queries, q.k, active)) return copy_lists(lists, q.k, active, out);
  if (is_whole || lists.all_identical() || last_lane - first_lane == 1) return search_there_exactly(q, active, out);
  const int middle = (first_lane + last_lane) / 2;
  search_there<K>(here, first, own, of_all, first_lane, middle, out);
  search_there<K>(here, first, own, of_all, middle, last_lane, out);
}

inline void nearest_there(const IndexView& here, Index leaf, const IndexView& there, const int* own, Index start, int k,
                          Index* out) {
  const QueriesThere of_all{there, {}, start, k};
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index first = leaf * kLeafSize + Index(part);
    const auto search = k <= 16 ? search_there<16> : search_there<64>;
    search(here, first, own + part, of_all, 0, kLanes, out + part);
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
