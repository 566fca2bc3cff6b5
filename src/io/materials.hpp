// SPDX-License-Identifier: Apache-2.0
// The materials of a mesh, as far as they have pictures.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/scalar.hpp"

namespace pointfair::io {

struct Material {
  std::string name;                           ///< by which a library of materials knows it
  std::string picture{};                      ///< its picture's name; empty: a library says it, or there is none
  std::shared_ptr<const std::string> held{};  ///< the picture's bytes, where the file itself holds them, else null
  std::string note{};                         ///< why the picture is not shown as the file means it
};

/// As a file names them; FaceVisitor::use() says which faces have which.
struct Materials {
  std::vector<Material> all;
  std::vector<std::string> libraries;  ///< files that say which pictures the materials have
  bool v_down = false;                 ///< texture coordinates count from the picture's upper left corner
};

/// Which two of these names are texture coordinates of points, as PLY files call them; empty if none are.
template <class Columns>
std::vector<std::string> texture_columns(const Columns& columns) {
  static constexpr std::pair<const char*, const char*> kNames[] = {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}};
  const auto has = [&](std::string_view name) {
    for (const auto& column : columns)
      if (column.name == name) return true;
    return false;
  };
  for (const auto& [u, v] : kNames)
    if (has(u) && has(v)) return {u, v};
  return {};
}

/// A material of a library, with its picture.
struct LibraryPicture {
  std::string material;
  std::string picture;
  bool altered = false;  ///< the library moves, scales or turns the picture, which is not done here
};

/// The pictures of diffuse colour (map_Kd) that a library of materials (MTL) names. Never fails: lines that say
/// something else are passed over.
std::vector<LibraryPicture> library_pictures(std::string_view text);

}  // namespace pointfair::io
