// SPDX-License-Identifier: Apache-2.0
#include "drawn_faces.hpp"

#include <algorithm>
#include <span>

namespace pointfair::viewer {

DrawnFaces drawn_faces(const Polygons& faces, const Order& order, std::size_t shown) {
  DrawnFaces drawn;
  if (shown < order.size() || faces.corners.size() > kMaxCorners) return drawn;
  drawn.ends.reserve(faces.ends.size());
  drawn.corners.reserve(faces.corners.size());
  std::uint64_t first = 0;
  for (const std::uint64_t end : faces.ends) {
    const std::span corners(faces.corners.data() + first, faces.corners.data() + end);
    first = end;
    if (!std::ranges::all_of(corners, [&](std::uint32_t corner) { return corner < shown; })) continue;
    for (const std::uint32_t corner : corners) drawn.corners.push_back(order.place(corner));
    drawn.ends.push_back(static_cast<std::uint32_t>(drawn.corners.size()));
  }
  return drawn;
}

}  // namespace pointfair::viewer
