// SPDX-License-Identifier: Apache-2.0
// The faces of a PLY file.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/ply_header.hpp"
#include "io/source.hpp"

namespace pointfair::io {

/// The header, and where each element's rows begin in the file, with the end of the last.
struct PlyFile {
  PlyHeader header;
  std::vector<std::size_t> begins;
  bool wrapped = false;  ///< the rows of a text do not keep to lines

  const PlyElement& vertex() const { return header.elements[header.vertex]; }
};

/// The list that names a face's corners; none if there are no faces.
struct FaceList {
  std::size_t element = 0, property = 0;
};
std::optional<FaceList> find_faces(const PlyFile& file);

/// Texture coordinates of corners, as MeshLab writes them.
bool is_texture(const PlyProperty& property);

/// Calls passed(begin, end) for the parts of the file that were read. Throws Error(file) for a corner that is no point.
void visit_faces(const PlyFile& file, std::string_view bytes, const std::string& name, FaceVisitor& visitor,
                 const std::function<void(std::size_t, std::size_t)>& passed);

}  // namespace pointfair::io
