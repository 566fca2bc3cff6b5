// SPDX-License-Identifier: Apache-2.0
// Exact distances to triangles, found through a tree of bounding boxes.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "vec3.hpp"

namespace pointfair::cli {

/// May be degenerate: two equal corners make a segment, three a point.
struct Triangle {
  Vec3 a, b, c;
};

struct Foot {
  Vec3 place;  ///< the closest point
  double squared_distance = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;  ///< that it lies on; of several the first that was found
};

/// Triangles that can be asked for their closest point by many threads at once.
class Surface {
 public:
  explicit Surface(std::vector<Triangle> triangles);
  ~Surface();

  Foot closest(Vec3 point) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace pointfair::cli
