// SPDX-License-Identifier: Apache-2.0
#include "io/ply_faces.hpp"

#include <algorithm>

#include "io/file_bytes.hpp"
#include "io/ply_body.hpp"

namespace pointfair::io {

std::optional<FaceList> find_faces(const PlyFile& file) {
  const auto& elements = file.header.elements;
  const auto face = std::ranges::find(elements, "face", &PlyElement::name);
  if (face == elements.end()) return std::nullopt;
  const std::size_t list = std::min(find_property(*face, "vertex_indices"), find_property(*face, "vertex_index"));
  if (list == face->properties.size() || !face->properties[list].list_count) return std::nullopt;
  return FaceList{static_cast<std::size_t>(face - elements.begin()), list};
}

bool is_texture(const PlyProperty& property) { return property.list_count && property.name == "texcoord"; }

namespace {

// Which of the header's images lies on a face, as MeshLab writes it.
bool is_image_number(const PlyProperty& property) { return !property.list_count && property.name == "texnumber"; }

// The corners or the texture coordinates of one face.
template <class T, class Next>
void read_list(PlyCursor& cursor, const PlyProperty& property, std::vector<T>& to, const Next& next) {
  to.clear();
  for (std::uint64_t left = cursor.next_list_size(property); left > 0; --left) to.push_back(next());
}

}  // namespace

void visit_faces(const PlyFile& file, std::string_view bytes, const std::string& name, FaceVisitor& visitor,
                 const std::function<void(std::size_t, std::size_t)>& passed) {
  constexpr std::size_t kPassed = std::size_t{1} << 20;  // bytes at a time
  const std::optional<FaceList> found = find_faces(file);
  if (!found) return;
  const PlyElement* const face = &file.header.elements[found->element];
  const std::size_t list = found->property;
  std::size_t begin = file.begins[found->element];
  const std::size_t left = file.begins[found->element + 1] - begin;
  PlyCursor cursor(bytes, begin, file.header, file.wrapped, name);
  const double points = static_cast<double>(file.vertex().count);
  visitor.expect({face->count, left / (file.header.encoding == Encoding::ascii ? 2 : 1), false});
  std::vector<std::uint32_t> corners;
  std::vector<float> texture;
  const std::size_t images = file.header.textures.size();
  if (images > 0) visitor.use(0);
  for (std::uint64_t row = 0; row < face->count; ++row) {
    cursor.begin_row();
    texture.clear();
    for (std::size_t p = 0; p < face->properties.size(); ++p) {
      const PlyProperty& property = face->properties[p];
      if (p == list) {
        read_list(cursor, property, corners, [&] {
          const double corner = cursor.next(property.type);
          if (!(corner >= 0 && corner < points))
            fail(name, "face " + std::to_string(row) + " names a point that is not there; repair the faces");
          return static_cast<std::uint32_t>(corner);
        });
      } else if (is_texture(property) && visitor.with_texture()) {
        read_list(cursor, property, texture, [&] { return static_cast<float>(cursor.next(property.type)); });
      } else if (is_image_number(property) && images > 0) {
        const double image = cursor.next(property.type);
        visitor.use(image >= 0 && image < static_cast<double>(images) ? static_cast<std::uint32_t>(image)
                                                                      : kNoMaterial);
      } else {
        cursor.skip(property);
      }
    }
    visitor.take(corners, texture);
    if (cursor.position() - begin >= kPassed) {
      passed(begin, cursor.position());
      begin = cursor.position();
    }
  }
}

}  // namespace pointfair::io
