// SPDX-License-Identifier: Apache-2.0
// The faces of a cloud as the page draws them.
#pragma once

#include <cstdint>
#include <vector>

#include "order.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// Faces over the places of the page: face f has the corners [ends[f - 1], ends[f]), the first from 0.
struct DrawnFaces {
  std::vector<std::uint32_t> ends, corners;
};

/// The page draws faces with at most so many corners together: 4 bytes each on their way, 16 there.
inline constexpr std::size_t kMaxCorners = 24'000'000;

/// The faces whose corners are points of the cloud. None where the page holds a part of the points only, or where there
/// are more than kMaxCorners corners. O(corners).
DrawnFaces drawn_faces(const Polygons& faces, const Order& order, std::size_t shown);

}  // namespace pointfair::viewer
