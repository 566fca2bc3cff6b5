// SPDX-License-Identifier: Apache-2.0
// The parameters that follow from what was measured of the cloud.
#pragma once

#include <limits>
#include <memory>

#include "estimate/estimate.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

// What follows the noise and the shape from place to place: what was automatic, in the bilateral method over radius
// neighbourhoods.
struct FollowedNoise {
  std::shared_ptr<const NoiseLevels> levels{};              // null: the noise is held to be the same everywhere
  std::shared_ptr<const NodeLevels> reach_levels{};         // of NeighborSettings
  double widest = std::numeric_limits<double>::infinity();  // the same
  bool radius = false, similarity = false, limit = false;   // and the similarity sigma, the displacement limit
  double outlier_distance = 0;                              // of level 1
  double damage = 0;   // of the share of each displacement (point/noise_field.h); 0: all is made
  double trusted = 0;  // noise of which half of that share is made, in place of the relaxation of a typical place
  double without_surface = 0;  // share of the cloud that does not move, since no surface shows
};

// What the automatic values of parameters follow from, so that nothing else need be measured.
struct Needed {
  WantedEstimates estimates;
  bool diagonal = false;
};
Needed needed_by(const Params& asked);

// What a run uses: no value of the parameters is automatic, and every length is in file units.
struct Resolved {
  Params params;
  FollowedNoise followed;
  KnownSensor sensor{};  // found with the noise; a place that is given goes before it
};
// Reads what needed_by() names and no more, so that a result does not depend on what else was measured.
Resolved resolve(const Params& asked, Estimate found, double diagonal);

// Whether neighbours are those of Params::rings.
bool follows_rings(const Params& params);

// Whether sums run over all points within a radius, and not over lists.
bool sums_within_radius(const Params& params);

// Whether outliers are looked for. Lists are the paper's road, which knows none; and where points also move along the
// surface, a long way says nothing of noise.
bool seeks_outliers(const Params& params);

}  // namespace pointfair
