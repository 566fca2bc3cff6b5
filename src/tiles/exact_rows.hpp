// SPDX-License-Identifier: Apache-2.0
// Samples of neighbourhoods where a part of a cloud is loaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "point/region.h"
#include "seam/backend.hpp"

namespace pointfair {

// Rows of the k nearest as Sampling::sample_neighborhoods() gives them, of the uploaded points at `places`, where all
// points of a larger cloud in `loaded` were uploaded. Copies each row that would be the same with the whole cloud to
// its place among `out`, which `rows` has; returns which of `rows` would not.
std::vector<std::size_t> sample_exact_rows(Backend& backend, const point::Region& loaded,
                                           std::span<const std::uint32_t> places, std::span<const std::size_t> rows,
                                           int k, std::span<Point> out);

}  // namespace pointfair
