// SPDX-License-Identifier: Apache-2.0
// The lines of an OBJ file without some of its points. All other lines stay as they are: materials, parts, texture
// coordinates, remarks.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/text_rows.hpp"

namespace pointfair::io {

class ObjRemoval {
 public:
  /// Without the points of which `removed` is not 0. `own_normals`: as ObjParts has it; then their normals go with
  /// them. Takes 4 bytes a point.
  ObjRemoval(std::span<const std::uint8_t> removed, bool own_normals, const RowShape& shape);

  /// Appends the lines of `text`, before which the file has so many points and normals. Points that are removed go,
  /// with the faces and lines (l) that have one as a corner; a list of points (p) loses those. What is left names the
  /// same points by their new numbers, counted from the end where it was. Every number must be one of a point.
  void append(std::string_view text, std::uint64_t points, std::uint64_t normals, std::string& to) const;

 private:
  struct Lines;
  bool is_removed(std::uint64_t point) const { return left_before_[point] == left_before_[point + 1]; }

  std::vector<std::uint32_t> left_before_;  // points; one more than the file has
  bool own_normals_;
  RowShape shape_;
};

}  // namespace pointfair::io
