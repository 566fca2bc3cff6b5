// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/contents.hpp"

#include <algorithm>
#include <map>
#include <new>
#include <set>
#include <string>

namespace pointfair::io::gltf {
namespace {

const Json& array_of(const Json& object, const char* key) {
  static const Json none = Json::array();
  const auto found = object.find(key);
  return found != object.end() && found->is_array() ? *found : none;
}

std::size_t count_with(const Json& objects, const char* key) {
  return static_cast<std::size_t>(
      std::ranges::count_if(objects, [&](const Json& object) { return object.contains(key); }));
}

class Contents {
 public:
  explicit Contents(const Json& document) : document_(document) {}

  std::vector<Content> all(const std::vector<bool>& visited) && {
    tell_count(ContentKind::materials, "materials", "material");
    tell_count(ContentKind::materials, "images", "image");
    const std::size_t names =
        count_with(array_of(document_, "nodes"), "name") + count_with(array_of(document_, "meshes"), "name");
    tell(ContentKind::groups, names, "name of a part", "names of parts");
    tell_primitives();
    for (const char* const kind : {"animation", "skin", "camera"})
      tell_count(ContentKind::records, std::string(kind) + "s", kind);
    tell_meshes_elsewhere(visited);
    for (const Json& extension : array_of(document_, "extensionsUsed"))
      if (extension.is_string())
        contents_.push_back({ContentKind::records, "the extension " + extension.get<std::string>()});
    return std::move(contents_);
  }

 private:
  void tell(ContentKind kind, std::size_t count, const std::string& one, const std::string& several) {
    if (count > 0) contents_.push_back({kind, std::to_string(count) + " " + (count == 1 ? one : several)});
  }
  void tell_count(ContentKind kind, const std::string& array, const std::string& one) {
    tell(kind, array_of(document_, array.c_str()).size(), one, one + "s");
  }

  void tell_primitives() {
    constexpr unsigned kTriangles = 4;
    std::size_t lines = 0, shapes = 0;
    std::set<std::string> attributes;
    for (const Json& mesh : array_of(document_, "meshes")) {
      for (const Json& primitive : array_of(mesh, "primitives")) {
        const unsigned mode = primitive.value("mode", kTriangles);
        lines += mode > 0 && mode < kTriangles ? 1 : 0;
        shapes += array_of(primitive, "targets").size();
        const Json named = primitive.value("attributes", Json::object());
        for (const auto& [name, accessor] : named.items())
          if (std::ranges::find(kReadAttributes, name) == std::end(kReadAttributes)) attributes.insert(name);
      }
    }
    tell(ContentKind::elements, lines, "mesh of lines", "meshes of lines");
    tell(ContentKind::records, shapes, "further shape of a mesh", "further shapes of meshes");
    for (const std::string& name : attributes) contents_.push_back({ContentKind::records, "the attribute " + name});
  }

  void tell_meshes_elsewhere(const std::vector<bool>& visited) {
    const Json& nodes = array_of(document_, "nodes");
    std::set<Json> in_scene;
    for (std::size_t n = 0; n < nodes.size(); ++n)
      if (visited[n] && nodes[n].contains("mesh")) in_scene.insert(nodes[n].at("mesh"));
    tell(ContentKind::records, array_of(document_, "meshes").size() - in_scene.size(), "mesh that is not in the scene",
         "meshes that are not in the scene");
  }

  const Json& document_;
  std::vector<Content> contents_;
};

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

std::vector<Content> further_contents(const Json& document, const std::vector<bool>& visited) {
  return Contents(document).all(visited);
}

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
