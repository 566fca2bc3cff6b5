// SPDX-License-Identifier: Apache-2.0
// What each stage reads of the parameters, so that a change tells which of them must run again.
#pragma once

#include "estimate/automatic.hpp"
#include "pointfair/params.hpp"
#include "seam/settings.hpp"

namespace pointfair {

struct Settings {
  NeighborSettings neighbors;
  NormalSettings normals;
  FairingSettings fairing;
  DisplacementLimits limits;  // of the download: no stage reads them
  friend bool operator==(const Settings&, const Settings&) = default;
};

// Of parameters of which none is automatic and every length is in file units, and of what follows the noise.
Settings settings_of(const Params& params, const FollowedNoise& followed);

// The first stage that reads something that differs; `iterations` if none does.
Stage first_difference(const Settings& a, const Settings& b);

}  // namespace pointfair
