// SPDX-License-Identifier: Apache-2.0
// The order of neighbours, the constrained rule, and the area weight of one point.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

using Index = unsigned;                            // of a point; a backend holds at most kNoNeighbor points
inline constexpr Index kNoNeighbor = 0xffffffffu;  // fills the places of a list that is too short

inline constexpr int kAreaNeighbors = 5;   // W_a is a mean over this many (paper, III.E)
inline constexpr int kLeastNeighbors = 3;  // fewer span no plane

// Squared distances of this size and above are not distances any more; points beyond kCoordinateLimit are not indexed.
inline constexpr float kCoordinateLimit = 1e18f;

POINTFAIR_INLINE bool is_coordinate(float value) {
  return value > -kCoordinateLimit && value < kCoordinateLimit;  // false for NaN
}
// `p`: anything with x, y and z.
template <class P>
POINTFAIR_INLINE bool is_indexable(const P& p) {
  return is_coordinate(p.x) && is_coordinate(p.y) && is_coordinate(p.z);
}

// The order of points at equal distances: by x, then by y, then by z, as numbers. So no list depends on the order of
// the points in memory or of the visits, and none changes where all points move by a vector without rounding. Points at
// the same position are alike: any of them may be listed.
template <class F>
POINTFAIR_INLINE decltype(F() < F()) lies_before(Vec3<F> a, Vec3<F> b) {
  return (a.x < b.x) | ((a.x == b.x) & ((a.y < b.y) | ((a.y == b.y) & (a.z < b.z))));
}

// A neighbour as one number: the bits of its squared distance, which order as the distances, over its place among the
// sorted points.
POINTFAIR_INLINE unsigned long long neighbor_key(float squared_distance, Index at) {
  union {
    float f;
    unsigned u;
  } bits = {squared_distance};
  return (static_cast<unsigned long long>(bits.u) << 32) | at;
}
POINTFAIR_INLINE float key_squared_distance(unsigned long long key) {
  union {
    unsigned u;
    float f;
  } bits = {static_cast<unsigned>(key >> 32)};
  return bits.f;
}
POINTFAIR_INLINE Index key_index(unsigned long long key) { return static_cast<Index>(key); }

// Whether `a` precedes `b` in a list. `position_of(at)` is asked only where the distances are equal; kNoNeighbor, which
// has no position, comes behind all others of its distance. Of points at the same position the first sorted one
// precedes, so that no two are equal.
template <class PositionOf>
POINTFAIR_INLINE bool precedes(unsigned long long a, unsigned long long b, const PositionOf& position_of) {
  const unsigned distance_a = static_cast<unsigned>(a >> 32), distance_b = static_cast<unsigned>(b >> 32);
  if (distance_a != distance_b) return distance_a < distance_b;
  if (key_index(a) == kNoNeighbor || key_index(b) == kNoNeighbor) return key_index(a) < key_index(b);
  const Vec3<float> p = position_of(key_index(a)), q = position_of(key_index(b));
  return lies_before(p, q) || (!lies_before(q, p) && key_index(a) < key_index(b));
}

// Squared distance from a box to a box, zero where they overlap; never above that of two points inside them.
template <class F>
POINTFAIR_INLINE F squared_gap(Vec3<F> min_a, Vec3<F> max_a, Vec3<F> min_b, Vec3<F> max_b) {
  const F zero = F{};
  const Vec3<F> gap = {larger(larger(min_a.x - max_b.x, min_b.x - max_a.x), zero),
                       larger(larger(min_a.y - max_b.y, min_b.y - max_a.y), zero),
                       larger(larger(min_a.z - max_b.z, min_b.z - max_a.z), zero)};
  return squared_length(gap);
}

// What grow_constrained found.
struct ConstrainedGrowth {
  int accepted = 0;      // members of N beside the point itself, at most k
  bool complete = true;  // false: a candidate beyond those given could still join
};

// The constrained neighbourhood of the paper (III.C), Eq. 7 of docs/how-it-works.md: candidates come nearest first; q
// joins N if d(q, N) < rho + delta, where N holds the point itself from the start. `candidate(i)` gives the offset of
// the i-th candidate from the point; `accept(i)` is called for those that join, in order; `member(i)` gives back the
// offset of the i-th that joined. `all_given` says that the cloud has no further candidates. Every member lies within
// the last candidate's distance, so a later candidate can only join while its distance is below the farthest member's
// plus the reach.
template <class Candidate, class Accept, class Member>
POINTFAIR_INLINE ConstrainedGrowth grow_constrained(int candidates, int k, float reach, bool all_given,
                                                    Candidate candidate, Accept accept, Member member) {
  ConstrainedGrowth growth;
  const float squared_reach = reach * reach;
  float farthest = 0;  // squared distance of the last member that joined
  float last = 0;
  for (int i = 0; i < candidates && growth.accepted < k; ++i) {
    const Vec3<float> q = candidate(i);
    last = squared_length(q);
    bool joins = last < squared_reach;
    for (int j = growth.accepted - 1; j >= 0 && !joins; --j) joins = squared_length(q - member(j)) < squared_reach;
    if (!joins) continue;
    accept(i);
    ++growth.accepted;
    farthest = last;
  }
  const float limit = square_root(farthest) + reach;
  growth.complete = growth.accepted == k || all_given || square_root(last) >= limit;
  return growth;
}

// W_a(v_j) before the choice of its power: the mean distance to the nearest `count` <= 5 neighbours.
// Sum of distances first to last, then one division; count >= 1.
template <class F>
POINTFAIR_INLINE F mean_distance(F sum_of_distances, F count) {
  return sum_of_distances / count;
}

}  // namespace pointfair::point
