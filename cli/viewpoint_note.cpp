// SPDX-License-Identifier: Apache-2.0
#include "viewpoint_note.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace pointfair::cli {
namespace {

constexpr double kFar = 100;  // diagonals; a crop of a flight has some dozens

struct Bounds {
  Position low, high;
};

Bounds bounds_of(const Cloud& cloud) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Bounds bounds{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
  for (const Point& p : cloud.points) {
    const std::array<float, 3> at{p.x, p.y, p.z};
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      bounds.low[axis] = std::min(bounds.low[axis], cloud.origin[axis] + at[axis]);
      bounds.high[axis] = std::max(bounds.high[axis], cloud.origin[axis] + at[axis]);
    }
  }
  return bounds;
}

double distance_outside(const Bounds& bounds, const Position& place) {
  std::array<double, 3> outside{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    outside[axis] = std::max({0.0, bounds.low[axis] - place[axis], place[axis] - bounds.high[axis]});
  return std::hypot(outside[0], outside[1], outside[2]);
}

}  // namespace

std::string far_viewpoint_note(std::span<const Position> viewpoints, const Cloud& cloud) {
  if (viewpoints.empty()) return "";
  const Bounds bounds = bounds_of(cloud);
  const double diagonal =
      std::hypot(bounds.high[0] - bounds.low[0], bounds.high[1] - bounds.low[1], bounds.high[2] - bounds.low[2]);
  double farthest = 0;
  for (const Position& place : viewpoints) {
    const double its = distance_outside(bounds, place);
    if (std::isfinite(its)) farthest = std::max(farthest, its);
  }
  if (!(diagonal > 0) || !std::isfinite(diagonal) || farthest <= kFar * diagonal) return "";
  return fmt::format(
      "the sensor stood {:.0f} diagonals outside the bounds of the cloud, so its place may be in another unit or "
      "coordinate system; --viewpoint x,y,z gives another, --viewpoint none gives none",
      farthest / diagonal);
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
