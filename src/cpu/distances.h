// SPDX-License-Identifier: Apache-2.0
// How far the nearest other points of each point of a leaf are, for what does not ask which these are: of equal
// distances any will do, so nothing is put in order but numbers. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/network.h"
#include "cpu/pack.h"
#include "cpu/search.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// The K least squared distances of each lane, ascending. Where fewer points are nearer than the query's limit, the
// limit stands in their place.
template <int K>
class DistanceLists {
 public:
  static constexpr bool kOrdersTies = false, kTakesEquals = false;
  static constexpr int kBatch = 48;
  static constexpr int kMaxBatch = kBatch + kLeafSize;

  POINTFAIR_INLINE DistanceLists(int k, Floats limit) : k_(k), limit_(limit) {}
  POINTFAIR_INLINE void clear() {
    for (Entry& entry : entry_) entry = entry_of(limit_);
  }
  POINTFAIR_INLINE Floats at(int s) const { return floats_of(entry_[s]); }
  POINTFAIR_INLINE Floats last() const { return at(k_ - 1); }
  POINTFAIR_INLINE static bool all_identical() { return false; }  // nothing is nearer than those, so the walk ends

  template <bool kOwn>
  void offer(const IndexView& index, const Queries& queries, Floats bound, const int* positions, int count) {
    Entry useful[kMaxBatch + kRound];
    const point::Vec3<Floats> here = queries.position;  // as in FastLists
    int n = 0;
    for (int i = 0; i < count; ++i) {
      const int at = positions[i];
      const Floats distance = point::squared_length(spread(index.x[at], index.y[at], index.z[at]) - here);
      Mask hit = distance < bound;
      if constexpr (kOwn) hit = hit & (queries.at != broadcast(at));
      useful[n] = entry_of(select(hit, distance, broadcast(kInfinity)));
      n += any(hit);
    }
    for (; n % kRound != 0; ++n) useful[n] = entry_of(broadcast(kInfinity));
#if defined(__clang__)  // as in FastLists
    Entry entries[K];
    __builtin_memcpy(entries, entry_, sizeof entries);
    for (int i = 0; i < n; i += kRound) merge(entries, useful + i);
    __builtin_memcpy(entry_, entries, sizeof entries);
#else
    for (int i = 0; i < n; i += kRound) merge(entry_, useful + i);
#endif
  }

 private:
  // Floats that are not negative order as their bits do; of those, AVX2 and AVX-512 find minima faster, SSE2 cannot.
#if defined(__SSE2__) && !defined(__AVX2__)
  using Entry = Floats;
  static POINTFAIR_INLINE Entry entry_of(Floats a) { return a; }
  static POINTFAIR_INLINE Floats floats_of(Entry a) { return a; }
#else
  using Entry = Ints;
  static POINTFAIR_INLINE Entry entry_of(Floats a) { return as_ints(a); }
  static POINTFAIR_INLINE Floats floats_of(Entry a) { return as_floats(a); }
#endif
  static constexpr int kRound = K < 16 ? K : 16;
  static constexpr int kPowerOfTwo = K <= 8 ? 8 : K <= 16 ? 16 : K <= 32 ? 32 : 64;

  static POINTFAIR_INLINE void merge(Entry* entries, Entry* round) {
    sort_run<0, kRound>(round);
    for (int i = 0; i < kRound; ++i) {
      Entry& kept = entries[K - kRound + i];
      kept = smaller(kept, round[kRound - 1 - i]);
    }
    sort_bitonic<kPowerOfTwo, kPowerOfTwo - K>(entries);
  }

  int k_;  // distances that are asked for, at most K
  Floats limit_;
  Entry entry_[K];
};

POINTFAIR_INLINE void copy_distances(Floats distance, Mask active, float* out) {
  store(out, select(active, distance, load(out)));
}

// Of lanes [first_lane, last_lane) of the pack that starts at sorted position `start`; the k nearest of each lie within
// `limit`, unless that is infinite.
template <int K>
void search_distances(const IndexView& index, Index start, int first_lane, int last_lane, int k, Floats limit,
                      float* out) {
  const Mask active = lanes_between(first_lane, last_lane) & (lane_numbers() < broadcast(int(index.points - start)));
  if (!any(active)) return;
  if (last_lane - first_lane == 1) {
    Index list[K * kLeafSize];
    find_alone(index, start + Index(first_lane), k, limit.v[first_lane], list);
    const point::Vec3<float> here = position_of(index, start + Index(first_lane));
    for (int s = 0; s < k; ++s) {
      const Index at = list[s * kLeafSize];
      out[s * kLeafSize + first_lane] =
          at == point::kNoNeighbor ? kInfinity : point::squared_length(position_of(index, at) - here);
    }
    return;
  }
  const Queries queries = make_queries(index, start, active, limit);
  DistanceLists<K> lists(k, queries.limit);
  GroupSearch<DistanceLists<K>> search(index, queries, lists, leaf_budget(k));
  if (search.run(start / kLeafSize, leaves_beside(K))) {
    for (int s = 0; s < k; ++s) copy_distances(lists.at(s), active, out + s * kLeafSize);
    return;
  }
  const int middle = (first_lane + last_lane) / 2;
  search_distances<K>(index, start, first_lane, middle, k, lists.last(), out);
  search_distances<K>(index, start, middle, last_lane, k, lists.last(), out);
}

// As search_distances, after a try within `likely` of each point: then few others are looked at.
template <int K>
void search_likely(const IndexView& index, Index start, int k, float likely, float* out) {
  const Mask active = lane_numbers() < broadcast(int(index.points - start));
  const Queries queries = make_queries(index, start, active, broadcast(likely));
  DistanceLists<K> lists(k, queries.limit);
  GroupSearch<DistanceLists<K>> search(index, queries, lists, leaf_budget(k));
  if (!search.run(start / kLeafSize, leaves_beside(K)) || any(active & ~(lists.last() < queries.limit)))
    return search_distances<K>(index, start, 0, kLanes, k, broadcast(kInfinity), out);
  for (int s = 0; s < k; ++s) copy_distances(lists.at(s), active, out + s * kLeafSize);
}

inline void nearest_distances(const IndexView& index, Index leaf, int k, float likely, float* out) {
  const auto search = k <= 8    ? search_likely<8>
                      : k <= 16 ? search_likely<16>
                      : k <= 20 ? search_likely<20>
                      : k <= 32 ? search_likely<32>
                                : search_likely<64>;
  for (int s = 0; s < k * kLeafSize; s += kLanes) store(out + s, broadcast(kInfinity));
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    if (start < index.points) search(index, start, k, likely, out + part);
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
