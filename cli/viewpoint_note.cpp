// SPDX-License-Identifier: Apache-2.0
#include "viewpoint_note.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace pointfair::cli {

std::string far_viewpoint_note(std::span<const Position> viewpoints, const Cloud& cloud, const Estimates& estimates) {
  constexpr double kFar = 100;  // diagonals; a crop of a flight has some dozens
  if (!(estimates.diagonal > 0)) return {};
  double farthest = 0;
  for (const Position& place : viewpoints) {
    double squares = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double offset = place[axis] - cloud.origin[axis];
      squares += std::pow(std::max({0.0, estimates.min[axis] - offset, offset - estimates.max[axis]}), 2);
    }
    if (std::isfinite(squares)) farthest = std::max(farthest, std::sqrt(squares));
  }
  if (farthest <= kFar * estimates.diagonal) return {};
  return fmt::format(
      "the sensor stood {:.0f} diagonals outside the bounds of the cloud, so its place may be in another unit or "
      "coordinate system; --viewpoint x,y,z gives another, --viewpoint none gives none",
      farthest / estimates.diagonal);
}

std::string grid_viewpoint_note(const Cloud& cloud) {
  const FileInfo info = file_info(cloud);
  if (info.grid_width == 0) return "";
  for (const FileInfo::Row& row : info.rows)
    if (row.name == "sensor") return fmt::format("the sensor stood at {}; --viewpoint none takes no place", row.value);
  if (!file_viewpoints(cloud).empty()) return "";
  return "the file does not say where the sensor stood, and its grid does not tell: --viewpoint x,y,z finds points "
         "between two surfaces (mixed pixels)";
}

}  // namespace pointfair::cli
