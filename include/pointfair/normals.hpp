// SPDX-License-Identifier: Apache-2.0
// Normals in files: which a file has, and new ones in their place.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <stop_token>
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
/// `signs`: as_given leaves all these rules out.
enum class NormalSigns : std::uint8_t { by_rules, as_given };
POINTFAIR_EXPORT void set_normals(Cloud& cloud, std::span<const Point> normals,
                                  std::span<const std::array<double, 3>> viewpoints = {},
                                  NormalSigns signs = NormalSigns::by_rules);

/// Turns unit normals, one for each point of the cloud and of any sign, so that neighbours agree: towards the sensor,
/// where the file or `viewpoints` says where it stood; else out of closed shapes, and up from what is flat. Each
/// connected part has its own sign. A normal that is zero stays so. The same bits for any order of the points and any
/// number of threads. O(N log N); 250 bytes a point. Throws ErrorKind::usage as set_normals does, and
/// ErrorKind::interrupted.
POINTFAIR_EXPORT void orient_normals(const Cloud& cloud, std::span<Point> normals,
                                     std::span<const std::array<double, 3>> viewpoints = {}, std::stop_token stop = {});

}  // namespace pointfair
