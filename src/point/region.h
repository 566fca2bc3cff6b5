// SPDX-License-Identifier: Apache-2.0
// A part of space of which all points of a larger cloud are loaded, and which results that leaves as they would be with
// the whole cloud loaded.
#pragma once

#include "point/neighbors.h"
#include "point/vec.h"

namespace pointfair::point {

// A closed box; its ends may be infinite.
struct Region {
  Vec3<float> min, max;
};

// Space between two corners, the lower ends inside, the upper ones outside; infinite ends. Cells that fill space hold
// every point once.
struct Cell {
  Vec3<float> min, max;
};

POINTFAIR_INLINE bool is_in_cell(const Cell& cell, Vec3<float> p) {
  return p.x >= cell.min.x && p.x < cell.max.x && p.y >= cell.min.y && p.y < cell.max.y && p.z >= cell.min.z &&
         p.z < cell.max.z;
}

POINTFAIR_INLINE bool is_inside(const Region& region, Vec3<float> p) {
  return p.x >= region.min.x && p.x <= region.max.x && p.y >= region.min.y && p.y <= region.max.y &&
         p.z >= region.min.z && p.z <= region.max.z;
}

// No point outside has a squared distance to the inner point p, as rounded by squared_length, below this. A difference
// and a square are rounded monotonously, and a sum is not below its terms.
POINTFAIR_INLINE float squared_gap_to_outside(const Region& region, Vec3<float> p) {
  const float x = smaller(p.x - region.min.x, region.max.x - p.x), y = smaller(p.y - region.min.y, region.max.y - p.y),
              z = smaller(p.z - region.min.z, region.max.z - p.z);
  const float gap = larger(smaller(smaller(x, y), z), 0.0f);
  return gap * gap;
}

// How a list was made.
struct ListRule {
  int k;
  float squared_limit;  // infinite for none
  bool constraint;
  float reach;
};

// Whether a list of neighbours has the entries that it would have with all points loaded. `found` of k entries, the
// last at `squared_last`, 0 if there is none. A constrained neighbourhood that is not full takes no point beyond its
// farthest member's distance plus the reach.
POINTFAIR_INLINE bool is_exact_list(const ListRule& rule, int found, float squared_last, float squared_gap) {
  if (squared_gap > 3e38f || squared_gap > rule.squared_limit) return true;
  if (found == rule.k) return squared_last < squared_gap;
  return rule.constraint && square_root(squared_gap) >= square_root(squared_last) + rule.reach;
}

// The same for everything within a radius.
POINTFAIR_INLINE bool is_exact_radius(float squared_radius, bool radius_found, float squared_gap) {
  return squared_gap > 3e38f || (radius_found && squared_radius < squared_gap);
}

// How far the search looked that found a radius: to one of the nearest points, whose distance the level of the reach
// may have made smaller.
POINTFAIR_INLINE float squared_search(float squared_radius, float reach_level) {
  const float level = smaller(reach_level, 1.0f);
  return 1.0001f * squared_radius / (level * level);
}

// The same for the mean distance to the five nearest points, all of which are loaded somewhere: none is farther than
// the sum of them.
POINTFAIR_INLINE bool is_exact_mean(float mean_distance, float squared_gap) {
  const float sum = 1.0001f * float(kAreaNeighbors) * mean_distance;
  return squared_gap > 3e38f || sum * sum < squared_gap;
}

// What became of a point, as bits.
enum Outcome : unsigned char {
  kExact = 1,  // as with the whole cloud loaded
  kTooFew = 2,
  kNoNormal = 4,
  kShort = 8,    // a constrained neighbourhood of fewer than k
  kIsCopy = 16,  // of another point, whose result it has; of tiles only (seam/copies.hpp)
};

// `found`: neighbours of the point, whose normal is zero where there is none.
POINTFAIR_INLINE unsigned char outcome_of(bool is_exact, bool is_short, float found, Vec3<float> normal) {
  unsigned outcome = 0;
  if (is_exact) outcome |= kExact;
  if (is_short) outcome |= kShort;
  if (normal.x == 0 && normal.y == 0 && normal.z == 0) {
    if (found < static_cast<float>(kLeastNeighbors))
      outcome |= kTooFew;
    else
      outcome |= kNoNormal;
  }
  return static_cast<unsigned char>(outcome);
}

}  // namespace pointfair::point
