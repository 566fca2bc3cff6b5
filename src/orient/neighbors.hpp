// SPDX-License-Identifier: Apache-2.0
// The nearest neighbours of all points of a cloud, with a k-d tree: the graph along which signs of normals go.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair::orient {

inline constexpr std::uint32_t kNone = 0xFFFFFFFF;

/// The `k` nearest other points of each point, nearest first, of equally near ones that with the lower index; kNone
/// where there are fewer. All points must be finite. O(N log N). Throws Error(interrupted) once `stop` is triggered.
std::vector<std::uint32_t> nearest_neighbors(std::span<const Point> points, std::size_t k, const std::stop_token& stop);

}  // namespace pointfair::orient
