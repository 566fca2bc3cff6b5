// SPDX-License-Identifier: Apache-2.0
// What a cloud's file says beside its points.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/io.hpp"

namespace pointfair {

struct FileInfo {
  struct Row {
    std::string name, value;
  };
  std::vector<Row> rows;                  ///< for people: version, software, coordinate system, ...
  std::optional<double> metres_per_unit;  ///< of the coordinates, where the file says so
  double step = 0;  ///< between coordinates where these are stored as integers, the coarsest axis's; else 0
  std::optional<Format> format;  ///< of the file; unset for a cloud made in memory
  bool has_attributes = true;    ///< false: this build cannot read their values (LAZ without LASzip)
};

/// O(1) in the points.
POINTFAIR_EXPORT FileInfo file_info(const Cloud& cloud);

}  // namespace pointfair
