// SPDX-License-Identifier: Apache-2.0
// Points that lie together and make one measurement: copies that are off from each other by nearly the spacing, a
// scanner's dense lines, rows that share an error each. What lies nearer is copies (estimate/copies_at_samples.hpp).
#pragma once

#include "estimate/nearest_rows.hpp"

namespace pointfair {

struct Repeats {
  int points = 1;  // that make one measurement at most samples, 1 to kMostRepeats
  int copies = 1;  // of these, at exactly one place
  bool rows_share_errors = false;
};

// Of points spread over a surface, the squared distance to the k-th nearest grows with k from the first one on; where
// it is far smaller before some k, as many lie together. Of rows that are off from each other, the
// most. Asks for rows of eight, and for longer ones where these are uneven or along lines.
Repeats repeats_among(const NearestRows& nearest, const ForEach& for_each);

}  // namespace pointfair
