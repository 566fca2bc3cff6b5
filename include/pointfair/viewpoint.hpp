// SPDX-License-Identifier: Apache-2.0
// Where the sensor stood that saw a cloud, for Pipeline::set_viewpoint and set_normals.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/positions.hpp"

namespace pointfair {

/// Where the sensor stood, as the cloud's file says it (the VIEWPOINT of PCD unless it is the default, the poses of
/// E57), in the file's coordinates: one position for all points, or one for each, or none where the file does not say.
/// An organised PCD file or an NPY file of shape (H, W, 3) shows it as image_viewpoint does. The position of a point
/// whose scan has no pose is NaN. O(N) for several scans, and the first time for an image, else O(1).
POINTFAIR_EXPORT std::vector<Position> file_viewpoints(const Cloud& cloud);

/// Where the camera stood whose image these points are, row by row of `width`: there the rays of its pixels meet. None
/// where it does not show, as of a scanner that turns, of a plane, or of points in no order. Points that are not finite
/// or (0, 0, 0) count for nothing. O(1): some thousand points.
POINTFAIR_EXPORT std::optional<Position> image_viewpoint(std::span<const Point> points, std::size_t width);
POINTFAIR_EXPORT std::optional<Position> image_viewpoint(std::span<const Position> points, std::size_t width);

/// The same as a user gives it: "x,y,z" in the file's coordinates; or the names of three attributes, "vx,vy,vz", that
/// hold the position for each point; or "none". An empty text means file_viewpoints. Throws ErrorKind::usage with the
/// expected form, and for attributes that the cloud does not have or that have more than one number a point.
POINTFAIR_EXPORT std::vector<Position> parse_viewpoints(std::string_view text, const Cloud& cloud);

/// Throws ErrorKind::usage if the text has none of these forms. Needs no cloud.
POINTFAIR_EXPORT void check_viewpoint(std::string_view text);

}  // namespace pointfair
