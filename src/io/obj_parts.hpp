// SPDX-License-Identifier: Apache-2.0
// What an OBJ file holds beside its points. Faces are not held, since they take more memory than their lines: they are
// read when they are asked for.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "io/contents.hpp"
#include "io/faces.hpp"
#include "io/materials.hpp"
#include "io/text_rows.hpp"

namespace pointfair::io {

/// Of the points.
class ObjNormals {
 public:
  using Normal = std::array<float, 3>;

  ObjNormals() = default;
  /// `of_points`: which normal a point has, kNone for none; empty if each has its own.
  ObjNormals(std::vector<Normal> values, std::vector<std::uint32_t> of_points)
      : values_(std::move(values)), of_points_(std::move(of_points)) {}

  bool empty() const { return values_.empty(); }
  Normal of(std::size_t point) const {
    const std::size_t normal = of_points_.empty() ? point : of_points_[point];
    return normal == kNone ? Normal{} : values_[normal];
  }

  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

 private:
  std::vector<Normal> values_;
  std::vector<std::uint32_t> of_points_;
};

struct ObjParts {
  std::string damage;         ///< what is wrong with the first face that names no point; or empty
  std::uint64_t normals = 0;  ///< lines of them
  ObjNormals point_normals;   ///< empty if the corners of a point differ
  ExpectedFaces faces;
  bool textured = false;          ///< some corner has texture coordinates
  bool own_normals = false;       ///< there is one for each point, in the same order, and corners name that one
  bool can_lose_points = true;    ///< nothing but faces, lines and points names points
  std::vector<Content> contents;  ///< all but faces and normals
  Materials materials;            ///< none without texture coordinates
};

/// The lines of an OBJ file.
struct ObjText {
  std::string_view rows, file;  ///< the rows of the whole file, which has the numbers of lines
  RowShape shape;
  std::uint64_t points = 0;
  std::function<void(std::string_view)> passed;  ///< is called for each part of the rows that was read
};

ObjParts read_obj_parts(const ObjText& text);

/// Gives the faces to the visitor, unless one is damaged.
void visit_obj_faces(const ObjText& text, const ObjParts& parts, FaceVisitor& visitor);

/// Whether some line of the text is a normal.
bool has_obj_normals(std::string_view text, const RowShape& shape);

}  // namespace pointfair::io
