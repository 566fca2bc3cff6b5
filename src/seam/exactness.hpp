// SPDX-License-Identifier: Apache-2.0
// What a tile asks of the backend that computes it: which results would be the same with the whole cloud loaded.
#pragma once

#include <span>
#include <vector>

#include "point/region.h"
#include "seam/backend.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {

class Exactness {
 public:
  virtual ~Exactness() = default;
  // After the first iteration's fairing, where what was uploaded are all points of a larger cloud in `loaded`: a
  // point::Outcome a point, in upload order; 0 for invalid points.
  virtual void outcomes(const point::Region& loaded, std::span<unsigned char> out) = 0;
};

inline constexpr point::Region kEverywhere{{-kUnbounded, -kUnbounded, -kUnbounded},
                                           {kUnbounded, kUnbounded, kUnbounded}};

inline void add(Counts& counts, unsigned char outcome) {
  counts.unmoved.too_few_neighbors += (outcome & point::kTooFew) != 0;
  counts.unmoved.no_normal += (outcome & point::kNoNormal) != 0;
  counts.short_neighborhoods += (outcome & point::kShort) != 0;
  counts.copies += (outcome & point::kIsCopy) != 0;
}

// Counts the copies, and each for the reasons of its first; `tell` writes the outcomes of the points.
template <class Tell>
void add_copies(std::span<const Copy> copies, std::size_t points, Counts& counts, const Tell& tell) {
  counts.copies = copies.size();
  const UnmovedCounts& unmoved = counts.unmoved;
  if (copies.empty() || unmoved.too_few_neighbors + unmoved.no_normal + counts.short_neighborhoods == 0) return;
  std::vector<unsigned char> outcomes(points);
  tell(outcomes);
  for (const Copy& copy : copies) add(counts, outcomes[copy.first]);
}

}  // namespace pointfair
