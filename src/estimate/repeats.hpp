// SPDX-License-Identifier: Apache-2.0
// Points that lie together and are no measurements of their own: copies, copies that were rounded otherwise, the
// corners of unwelded faces, what a sensor emits several times, a scanner's dense lines, rows that share an error each.
#pragma once

#include "estimate/nearest_rows.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {

struct Repeats {
  int points = 1;  // that make one measurement at most samples, 1 to kMostRepeats
  int copies = 1;  // of these, at exactly one place
};

// Copies that some samples have, up to a distance that is far below the next one.
struct CopiesFound {
  double points = 1;   // for one measurement, over the cloud
  double within = -1;  // negative: there are none
};
// Asks for the nearest points of rank 17, and for longer rows where some of these lie together. Copies by chance, of
// coordinates that were rounded as coarsely as points lie apart, are none.
CopiesFound copies_at_samples(const NearestRows& nearest);

// Of points spread over a surface, the squared distance to the k-th nearest grows with k from the first one on; where
// it is far smaller before some k, as many lie together. Of rows that are off from each other, the
// most. Asks for rows of eight, and for longer ones where these are uneven or along lines.
Repeats repeats_among(const NearestRows& nearest, const ForEach& for_each);

}  // namespace pointfair
