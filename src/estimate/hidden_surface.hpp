// SPDX-License-Identifier: Apache-2.0
// A surface that most of its neighbours do not lie on, such as the ground between crowns.
#pragma once

#include <span>
#include <vector>

#include "estimate/nearest_rows.hpp"
#include "point/sample.h"
#include "seam/cloud_sample.hpp"

namespace pointfair {

// Which samples lie on a surface; empty where the cloud hides none, as nearly all. The noise of samples on a hidden
// surface becomes what the best half of their 16 nearest points lies off a plane. Those whose noise is far beyond that,
// and about as large as their neighbourhood, show no surface. `rows`: of the first of these samples.
std::vector<bool> find_hidden_surface(NearestRows& rows, std::vector<point::NoiseSample>& samples,
                                      const ForEach& for_each);

}  // namespace pointfair
