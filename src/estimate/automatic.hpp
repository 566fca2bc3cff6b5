// SPDX-License-Identifier: Apache-2.0
// The parameters that follow from what was measured of the cloud.
#pragma once

#include <limits>
#include <memory>

#include "estimate/estimate.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

// Replaces each `auto` by what follows from the spacing and noise, and every length by file units.
Params resolve_params(const Params& params, const Spacing& spacing, const Noise& noise, double diagonal);

// What follows the noise and the shape from place to place: what was automatic, in the bilateral method over radius
// neighbourhoods.
struct FollowedNoise {
  std::shared_ptr<const NoiseLevels> levels{};              // null: the noise is held to be the same everywhere
  std::shared_ptr<const NodeLevels> reach_levels{};         // of NeighborSettings
  double widest = std::numeric_limits<double>::infinity();  // the same
  bool radius = false, similarity = false, limit = false;   // and the similarity sigma, the displacement limit
  double outlier_distance = 0;                              // of level 1
  double damage = 0;  // of the share of each displacement (point/noise_field.h); 0: all is made
};
FollowedNoise followed_noise(const Params& asked, const Params& used, const Noise& noise,
                             std::shared_ptr<const NoiseLevels> levels, std::shared_ptr<const NodeLevels> reach_levels);

// Whether neighbours are those of Params::rings.
bool follows_rings(const Params& params);

// Whether sums run over all points within a radius, and not over lists.
bool sums_within_radius(const Params& params);

// Whether `resolve_params` would look at the spacing, at the noise, at the diagonal.
bool needs_spacing(const Params& params);
bool needs_noise(const Params& params);
bool needs_diagonal(const Params& params);

}  // namespace pointfair
