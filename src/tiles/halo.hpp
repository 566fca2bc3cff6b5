// SPDX-License-Identifier: Apache-2.0
// How much around a tile is loaded. It decides how often points must be done again, and no result.
#pragma once

#include "point/region.h"
#include "seam/cloud_sample.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// `wanted` grown by the halo, without an end where the cloud, whose bounds are `whole`, ends.
point::Region region_around(const Bounds& whole, const Bounds& wanted, double halo);

// Whether all points with these bounds lie in the region, and whether any may.
bool lies_inside(const point::Region& region, const Bounds& b);
bool may_overlap(const point::Region& region, const Bounds& b);

// How far the k nearest of a surface with the points of `b` should reach, and then some.
double reach_of_nearest(const Bounds& whole, double k, const Bounds& b);

// How wide a halo should be for most points of a tile with these bounds.
double first_halo(const Bounds& whole, const FramedSettings& stages, const Bounds& b);

}  // namespace pointfair
