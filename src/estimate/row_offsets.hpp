// SPDX-License-Identifier: Apache-2.0
// Rows of points that share an error each, as the rings of a lidar whose beams are off from each other.
#pragma once

#include "estimate/nearest_rows.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {

// Whether rows lie off a smooth surface by more than their own points do, each row by an error of its own: from row to
// row these jump, where shape goes on. Asks for few long rows of neighbours, where the nearest points lie along lines.
bool rows_share_errors(const NearestRows& nearest, const ForEach& for_each);

}  // namespace pointfair
