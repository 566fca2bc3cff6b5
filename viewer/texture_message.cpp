// SPDX-License-Identifier: Apache-2.0
#include "texture_message.hpp"

#include <fmt/format.h>

#include <span>
#include <string>
#include <vector>

#include "drawn_faces.hpp"

namespace pointfair::viewer {

Bytes texture_message(const Json& id, const Cloud& cloud, const Texture& texture, const Companions& companions,
                      const Order& order, std::size_t shown) {
  Json pictures = Json::array(), notes = texture.notes;
  std::vector<std::string> files;
  std::vector<std::uint32_t> sent(texture.pictures.size(), kNoPicture);
  for (std::size_t p = 0; p < texture.pictures.size(); ++p) {
    try {
      std::string bytes = picture_bytes(texture.pictures[p], companions);
      sent[p] = static_cast<std::uint32_t>(files.size());
      pictures.push_back({{"name", texture.pictures[p].name}, {"type", picture_type(bytes)}});
      files.push_back(std::move(bytes));
    } catch (const Error& error) {
      notes.push_back(error.what());
    }
  }
  const TextureMap map = texture_map(cloud, texture);
  DrawnFaces faces = drawn_faces(polygons(cloud), order, shown, &map);
  for (std::uint32_t& picture : faces.pictures)
    if (picture != kNoPicture) picture = sent[picture];
  std::vector<Array> arrays{make_array("coordinates", faces.coordinates), make_array("face_pictures", faces.pictures)};
  std::vector<std::string> names;
  for (std::size_t p = 0; p < files.size(); ++p) names.push_back(fmt::format("picture{}", p));
  for (std::size_t p = 0; p < files.size(); ++p)
    arrays.push_back({names[p], kTypeName<std::uint8_t>, files[p].size(), std::as_bytes(std::span(files[p]))});
  return pack({{"type", "texture"}, {"id", id}, {"pictures", pictures}, {"notes", notes}}, arrays);
}

}  // namespace pointfair::viewer
