// SPDX-License-Identifier: Apache-2.0
// Normals in files: which a file has, and new ones in their place.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"

namespace pointfair {

/// The names of the attributes that hold the normals of the cloud: three of one float each (nx, ny, nz and their other
/// names), or one of three floats; empty if it has none.
POINTFAIR_EXPORT std::vector<std::string> normal_attributes(const Cloud& cloud);

/// Gives the cloud these unit normals, one a point, in file order: in the place of its own or, if it has none, as the
/// added attribute "normal". A normal that is zero leaves a point's own.
/// Their sign is that of the cloud's own; else they look towards the sensor, where the file says where it stood (the
/// VIEWPOINT of PCD unless it is the default, the poses of E57); else outward: up if the cloud is less than a quarter
/// as high as wide, as a landscape is, and away from the middle of its bounding box if not. Throws ErrorKind::usage if
/// there is not one for each point. O(N).
/// `viewpoints`: where the sensor stood instead, as parse_viewpoints gives it, one position or one for each point;
/// normals look there whatever the file says, except where it is not finite.
POINTFAIR_EXPORT void set_normals(Cloud& cloud, std::span<const Point> normals,
                                  std::span<const std::array<double, 3>> viewpoints = {});

}  // namespace pointfair
