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
  std::vector<float> coordinates;       ///< in its picture, two for each corner, where a map was given
  std::vector<std::uint32_t> pictures;  ///< of each face, or kNoPicture; the same
};

/// The page draws faces with at most so many corners together: 4 bytes each on their way, 16 there.
inline constexpr std::size_t kMaxCorners = 24'000'000;

/// Whether the page draws these faces of a cloud: it holds all points, and there are at most kMaxCorners corners.
bool are_drawn(const Polygons& faces, std::uint64_t points, std::uint64_t shown);

/// The faces whose corners are points of the cloud. None where they are not drawn.
/// `map`: where pictures lie on the same faces, or null. O(corners).
DrawnFaces drawn_faces(const Polygons& faces, const Order& order, std::size_t shown, const TextureMap* map = nullptr);

}  // namespace pointfair::viewer
