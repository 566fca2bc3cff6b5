// SPDX-License-Identifier: Apache-2.0
// What an OBJ file holds beside its points.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "io/contents.hpp"
#include "io/source.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {

struct ObjParts {
  Faces faces;
  std::string damage;  ///< what is wrong with the first face that names no point: there are no faces then; or empty
  std::uint64_t normals = 0;                        ///< lines of them
  std::vector<std::array<float, 3>> point_normals;  ///< one for each point; empty if the corners of a point differ
  std::vector<Content> contents;                    ///< all but faces and normals
};

/// `text` has the rows, `file` is the whole file, for line numbers.
ObjParts parse_obj_parts(std::string_view text, std::string_view file, const RowShape& shape, std::uint64_t points);

/// Whether some line of the text is a normal.
bool has_obj_normals(std::string_view text, const RowShape& shape);

}  // namespace pointfair::io
