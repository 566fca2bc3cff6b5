// SPDX-License-Identifier: Apache-2.0
// What the records of a LAS file say of its coordinates: a name for people, and what a unit is.
#pragma once

#include <optional>
#include <string>

#include "io/las/header.hpp"

namespace pointfair::io::las {

struct CoordinateSystem {
  std::string name;                         ///< empty: the file does not say
  std::optional<double> metres_per_unit;    ///< none: the file does not say, or the unit is an angle
  std::optional<double> metres_per_height;  ///< the same of Z, where heights have a unit of their own
  bool is_geographic = false;               ///< X and Y are angles
};

CoordinateSystem coordinate_system(const Header& header);
/// Whether it stands in GeoTIFF keys alone, which point formats from 6 on do not have.
bool has_geotiff_keys(const Header& header);

}  // namespace pointfair::io::las
