// SPDX-License-Identifier: Apache-2.0
// What a cloud's file says beside its points.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/io.hpp"

namespace pointfair {

/// What the file of a cloud says about itself.
struct FileInfo {
  struct Row {
    std::string name, value;
  };
  std::vector<Row> rows;                    ///< for people: version, software, coordinate system, ...
  std::optional<double> metres_per_unit;    ///< of the coordinates, where the file says so
  std::optional<double> metres_per_height;  ///< of Z, where the file says it
  double step = 0;                ///< between coordinates that are stored as integers, on the coarsest axis; else 0
  std::optional<Format> format;   ///< of the file; unset for a cloud made in memory
  std::uint64_t grid_width = 0;   ///< of an image of points (organised PCD, NPY): points a row; else 0
  std::uint64_t grid_height = 0;  ///< rows of that grid
  bool is_octree = false;         ///< a COPC file, whose points are in the order of an octree
  bool has_old_classes = false;   ///< LAS point formats 0 to 5: classes 0 to 31, of which 10, 11 and 13 on are reserved
  bool is_geographic = false;     ///< X and Y are longitude and latitude in degrees, so distances mean nothing

  /// Whether heights have another unit than X and Y, as far as the file says both.
  bool has_two_units() const {
    constexpr double kSame = 1e-5;  // the two kinds of feet differ by 2e-6, which no height shows
    return metres_per_unit && metres_per_height && std::abs(*metres_per_height / *metres_per_unit - 1) > kSame;
  }
};

/// What the cloud's file says. O(1) in the points, but the first time for an organised file without a place of the
/// sensor, O(N).
POINTFAIR_EXPORT FileInfo file_info(const Cloud& cloud);

/// Throws ErrorKind::file if the cloud's file says that its coordinates are geographic. Pipeline::run does so.
POINTFAIR_EXPORT void check_not_geographic(const Cloud& cloud);

}  // namespace pointfair
