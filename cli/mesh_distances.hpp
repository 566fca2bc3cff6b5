// SPDX-License-Identifier: Apache-2.0
// Exact distances to triangles, and how the faces of one mesh differ from another mesh.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"
#include "statistics.hpp"
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

/// Triangles that can be asked for their closest point by many threads at once, through a tree of bounding boxes.
class Surface {
 public:
  explicit Surface(std::vector<Triangle> triangles);
  ~Surface();

  Foot closest(Vec3 point) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

/// The faces of a mesh as triangles, those whose corners are finite.
std::vector<Triangle> finite_triangles(std::span<const Vec3> vertices, const Polygons& faces);

/// For every vertex the first of those at its place.
std::vector<std::uint32_t> weld(std::span<const Vec3> vertices);

struct FaceComparison {
  std::uint64_t faces = 0;          ///< of A, that have an area
  std::uint64_t folded = 0;         ///< of them, whose normal is more than 90 degrees off B's
  double normal_error = 0;          ///< mean angle between both, degrees
  bool turned = false;              ///< most of A's area faces the other way than B's: all faces were turned before
  Statistics back;                  ///< distances of B's vertices to A's faces
  std::optional<double> volume;     ///< of A; none where an edge has not two faces of one orientation
  std::optional<double> reference;  ///< of B
};

/// B's normal is that of the face of the same number where both meshes have the same faces, else of the face of B that
/// is nearest to the middle of A's corners. All of A's normals are turned round where that suits most of A's area.
/// `surface` is of finite_triangles(b). O((A + B) log(A + B)).
FaceComparison compare_faces(std::span<const Vec3> a, const Polygons& faces_a, std::span<const Vec3> b,
                             const Polygons& faces_b, const Surface& surface);

}  // namespace pointfair::cli
