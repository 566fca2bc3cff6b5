// SPDX-License-Identifier: Apache-2.0
// The bounds of coordinates that the XML section of an E57 file names.
#pragma once

#include <string>
#include <vector>

#include "io/box_of.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io::e57 {

/// The least and the greatest coordinates of points of a scan: x, y, z; range, azimuth, elevation.
struct Extent {
  BoxOf<double> cartesian, spherical;

  void add(const Extent& other) {
    cartesian.add(other.cartesian);
    spherical.add(other.spherical);
  }
};

/// The XML section with each bound that a scan's extent exceeds moved out to it; all else as it is, and no shorter.
std::string widened_bounds(const std::string& xml, const std::vector<Extent>& extents);

}  // namespace pointfair::io::e57
