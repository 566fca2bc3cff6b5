// SPDX-License-Identifier: Apache-2.0
// Noise that is not white: whether neighbours share theirs, and whether more points do than a neighbourhood holds.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>

#include "estimate/nearest_rows.hpp"
#include "seam/sampling.hpp"

namespace pointfair {

// Residuals that grow with the neighbourhood, and points that lie close together in rows, look as if neighbours shared
// their noise. Whether the nearest points of samples differ less in height than points farther away do, and not by more
// than noise of that standard deviation lets them, as on a bent shape. Asks for rows of the samples that are looked at
// first.
bool neighbors_share_noise(const NearestRows& nearest, double sigma, const ForEach& for_each);

// Whether the noise is correlated among more points than a neighbourhood holds: between every second and every fourth
// point as much as between neighbours, among which residuals in flat places grow by `growth` (endless: they are
// repeats, which tell nothing), and still between every eighth, where residuals grow less and are less against the
// spacing. Residuals of shape grow more with each scale or with some, those of natural ground stay as large against the
// spacing, those of a relief of one wavelength end with it, and those of other rough surfaces are large.
bool is_correlated_far(Sampling& from, std::span<const std::uint32_t> queries, double growth,
                       const std::stop_token& stop);

}  // namespace pointfair
