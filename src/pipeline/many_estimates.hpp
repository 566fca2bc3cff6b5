// SPDX-License-Identifier: Apache-2.0
// Clouds that are computed at once, each by its own estimates.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "pointfair/params.hpp"
#include "seam/backend.hpp"

namespace pointfair {

// Whether clouds whose parameters differ can be computed at once, by a backend that has many_clouds().
bool may_differ(const Params& params);

// Measures and computes the clouds that were uploaded together, up to the download; `points` are all of theirs, cloud i
// from ends[i - 1] to ends[i]. Returns those that must be computed alone instead.
std::vector<std::uint32_t> run_by_estimates(Backend& backend, std::span<const Point> points,
                                            std::span<const std::uint32_t> ends, const Params& params,
                                            const std::stop_token& stop);

}  // namespace pointfair
