// SPDX-License-Identifier: Apache-2.0
#include "io/ply_faces.hpp"

#include <algorithm>

#include "io/file_bytes.hpp"
#include "io/ply_body.hpp"

namespace pointfair::io {

std::optional<FaceList> find_faces(const PlyFile& file) {
  const auto& elements = file.header.elements;
  const auto face =
      std::find_if(elements.begin(), elements.end(), [](const PlyElement& e) { return e.name == "face"; });
  if (face == elements.end()) return std::nullopt;
  const std::size_t list = std::min(find_property(*face, "vertex_indices"), find_property(*face, "vertex_index"));
  if (list == face->properties.size() || !face->properties[list].list_count) return std::nullopt;
  return FaceList{static_cast<std::size_t>(face - elements.begin()), list};
}

bool is_texture(const PlyProperty& property) { return property.list_count && property.name == "texcoord"; }

Faces read_faces(const PlyFile& file, std::string_view bytes, const std::string& name) {
  Faces faces;
  const std::optional<FaceList> found = find_faces(file);
  if (!found) return faces;
  const PlyElement* const face = &file.header.elements[found->element];
  const std::size_t list = found->property;
  PlyCursor cursor(bytes, file.begins[found->element], file.header, file.wrapped, name);
  const double points = static_cast<double>(file.vertex().count);
  for (std::uint64_t row = 0; row < face->count; ++row) {
    cursor.begin_row();
    for (std::size_t p = 0; p < face->properties.size(); ++p) {
      const PlyProperty& property = face->properties[p];
      if (is_texture(property)) {
        for (std::uint64_t left = cursor.next_list_size(property); left > 0; --left)
          faces.texture.push_back(static_cast<float>(cursor.next(property.type)));
        continue;
      }
      if (p != list) {
        cursor.skip(property);
        continue;
      }
      for (std::uint64_t left = cursor.next_list_size(property); left > 0; --left) {
        const double corner = cursor.next(property.type);
        if (!(corner >= 0 && corner < points)) {
          fail(name, "face " + std::to_string(row) + " names a point that is not there; repair the faces");
        }
        faces.corners.push_back(static_cast<std::uint32_t>(corner));
      }
    }
    faces.ends.push_back(faces.corners.size());
  }
  if (faces.texture.size() != 2 * faces.corners.size()) faces.texture.clear();
  return faces;
}

}  // namespace pointfair::io
