// SPDX-License-Identifier: Apache-2.0
// Noise that more points share than a neighbourhood holds, by every second to every eighth point.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>

#include "seam/sampling.hpp"

namespace pointfair {

// Whether the noise is correlated among more points than a neighbourhood holds: between every second and every fourth
// point as much as between neighbours, among which residuals in flat places grow by `growth` (endless: they are
// repeats, which tell nothing), and still between every eighth, where residuals grow less and are less against the
// spacing. Residuals of shape grow more with each scale or with some, those of natural ground stay as large against the
// spacing, those of a relief of one wavelength end with it, and those of other rough surfaces are large.
bool is_correlated_far(Sampling& from, std::span<const std::uint32_t> queries, double growth,
                       const std::stop_token& stop);

}  // namespace pointfair
