// SPDX-License-Identifier: Apache-2.0
#include "drawn_faces.hpp"

#include <algorithm>
#include <span>
#include <utility>

namespace pointfair::viewer {

bool are_drawn(const Polygons& faces, std::uint64_t points, std::uint64_t shown) {
  return faces.size() > 0 && shown >= points && faces.corners.size() <= kMaxCorners;
}

DrawnFaces drawn_faces(const Polygons& faces, const Order& order, std::size_t shown, const TextureMap* map) {
  DrawnFaces drawn;
  if (!are_drawn(faces, order.size(), shown)) return drawn;
  drawn.ends.reserve(faces.ends.size());
  drawn.corners.reserve(faces.corners.size());
  std::size_t end = 0;
  for (std::size_t face = 0; face < faces.size(); ++face) {
    const std::size_t first = std::exchange(end, static_cast<std::size_t>(faces.ends[face]));
    const std::span corners(faces.corners.data() + first, faces.corners.data() + end);
    if (!std::ranges::all_of(corners, [&](std::uint32_t corner) { return corner < shown; })) continue;
    for (const std::uint32_t corner : corners) drawn.corners.push_back(order.place(corner));
    drawn.ends.push_back(static_cast<std::uint32_t>(drawn.corners.size()));
    if (!map) continue;
    drawn.pictures.push_back(map->pictures[face]);
    const auto at = map->coordinates.begin();
    drawn.coordinates.insert(drawn.coordinates.end(), at + std::ptrdiff_t(2 * first), at + std::ptrdiff_t(2 * end));
  }
  return drawn;
}

}  // namespace pointfair::viewer
