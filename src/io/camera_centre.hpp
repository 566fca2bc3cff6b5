// SPDX-License-Identifier: Apache-2.0
// Where the sensor stood that made an image of points, from the points alone: the rays of a camera meet there.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "io/source.hpp"

namespace pointfair::io {

/// A point, and its column and row in the image.
struct PixelPoint {
  Position point{};
  std::array<double, 2> pixel{};
};

/// The centre of the camera that maps the points to their pixels by a 3 x 4 matrix (the direct linear transform:
/// Hartley and Zisserman, Multiple View Geometry, 2004, 7.1). Noise along the rays does not change it. Nothing where no
/// such matrix gives the pixels to a tenth of one, as of a scanner that turns; where rays are parallel; or where the
/// points do not determine the centre, since another matrix does nearly as well, as for a plane, or two halves of the
/// points differ by more than a hundredth of its distance.
std::optional<Position> camera_centre(std::span<const PixelPoint> points);

/// The same of some thousand points of a file that lie row by row.
std::optional<Position> camera_centre(const Source& source, std::uint64_t width);

/// That place in words.
std::string where_rays_meet(const Position& place);

}  // namespace pointfair::io
