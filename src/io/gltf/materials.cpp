// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/materials.hpp"

#include <map>
#include <new>
#include <string>

namespace pointfair::io::gltf {
namespace {

// Images that were read, by their index.
using Images = std::map<std::size_t, std::pair<std::string, std::shared_ptr<const std::string>>>;

void take_picture(const Document& document, const Json& material, Images& known, Material& its) {
  const Json surface = material.value("pbrMetallicRoughness", Json::object());
  const auto colour = surface.find("baseColorTexture");
  if (colour == surface.end()) return;
  const Json& texture = document.element("textures", colour->at("index"));
  const Json extensions = texture.value("extensions", Json::object());
  const auto webp = extensions.find("EXT_texture_webp");
  const Json source = webp != extensions.end() ? webp->at("source") : texture.at("source");
  const auto [place, is_new] = known.try_emplace(source.get<std::size_t>());
  if (is_new) place->second = document.image(source);
  its.picture = place->second.first;
  its.held = place->second.second;
  const bool moved = colour->value("extensions", Json::object()).contains("KHR_texture_transform");
  if (moved || colour->value("texCoord", 0) != 0)
    its.note = its.picture + " is moved, or has texture coordinates of its own, which are not read";
}

}  // namespace

Materials materials_of(const Document& document) {
  Materials result;
  result.v_down = true;
  Images known;
  const Json materials = document.json().value("materials", Json::array());
  for (const Json& material : materials) {
    Material& its = result.all.emplace_back();
    its.name = std::to_string(result.all.size() - 1);
    try {
      take_picture(document, material, known, its);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception&) {
      its.note = "the picture of material " + its.name + " cannot be read; export " + document.name() + " again";
    }
  }
  return result;
}

}  // namespace pointfair::io::gltf
