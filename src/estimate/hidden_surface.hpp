// SPDX-License-Identifier: Apache-2.0
// A surface that most of its neighbours do not lie on, such as the ground between crowns.
#pragma once

#include <span>
#include <vector>

#include "estimate/nearest_rows.hpp"
#include "point/sample.h"
#include "seam/cloud_sample.hpp"

namespace pointfair {

// Which samples lie on a surface; empty for a cloud that hides none, as nearly all. The noise of a sample on a hidden
// surface becomes the deviation of the best half of its 16 nearest points from a plane. Samples with far more noise
// than that, about as much as their neighbourhood is wide, show no surface. `rows` are those of the first samples.
std::vector<bool> find_hidden_surface(NearestRows& rows, std::vector<point::NoiseSample>& samples,
                                      const ForEach& for_each);

}  // namespace pointfair
