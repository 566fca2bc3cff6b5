// SPDX-License-Identifier: Apache-2.0
// The bounds of coordinates that the XML section of an E57 file names.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "io/source.hpp"

namespace pointfair::io::e57 {

/// The least and the greatest coordinates of points of a scan: x, y, z, range, azimuth, elevation.
struct Extent {
  std::array<double, 6> min, max;

  Extent() {
    min.fill(std::numeric_limits<double>::infinity());
    max.fill(-std::numeric_limits<double>::infinity());
  }
  void add(const Position& cartesian, const Position* spherical);
  void add(const Extent& other);
};

/// The XML section with each bound that a scan's extent exceeds moved out to it; all else as it is, and no shorter.
std::string widened_bounds(const std::string& xml, const std::vector<Extent>& extents);

}  // namespace pointfair::io::e57
