// SPDX-License-Identifier: Apache-2.0
// Whether a cloud has copies of points, exact or but for their rounding: points that a file holds several times, where
// two tiles overlap, the corners of unwelded faces, what a sensor emits several times.
#pragma once

#include "estimate/nearest_rows.hpp"

namespace pointfair {

// Copies that some samples have, up to a distance that is far below the next one.
struct CopiesFound {
  double points = 1;   // for one measurement, over the cloud
  double within = -1;  // negative: there are none
};
// Asks for the nearest points of rank 17, and for longer rows where some of these lie together. Copies by chance, of
// coordinates that were rounded as coarsely as points lie apart, are none.
CopiesFound copies_at_samples(const NearestRows& nearest, const ForEach& for_each);

}  // namespace pointfair
