// SPDX-License-Identifier: Apache-2.0
// The pictures that a mesh's file lays on its faces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"

namespace pointfair {

/// Stands for no picture.
inline constexpr std::uint32_t kNoPicture = ~std::uint32_t{0};

/// A picture that a mesh's file names or holds.
struct TexturePicture {
  std::string name;                  ///< as it is written: a path from the mesh's file, or what it is called inside
  std::span<const std::byte> bytes;  ///< of one that the file itself holds, while `Cloud::source` lives; else empty
};

/// The pictures of a mesh, and which of its materials has which.
struct Texture {
  std::vector<TexturePicture> pictures;
  std::vector<std::uint32_t> of_materials;  ///< an index of `pictures` for each material of the file, or kNoPicture
  std::vector<std::string> notes;           ///< what is missing or is not shown as the file means it, a line each
};

/// Where the pictures lie on the faces.
struct TextureMap {
  std::vector<float> coordinates;  ///< u and v of each corner of `polygons(cloud)`; (0, 0) is the lower left corner
                                   ///< of the picture, (1, 1) the upper right one; 0 for faces without a picture
  std::vector<std::uint32_t> pictures;  ///< of each face: an index of `Texture::pictures`, or kNoPicture
};

/// Reads a file that a mesh's file names, by the name that is written there. Throws Error with a line that says why it
/// cannot.
using ReadNamed = std::function<std::string(const std::string& name)>;

/// The pictures of the faces of the cloud's file: those that a PLY file names in `comment TextureFile`, those of the
/// materials of an OBJ file (`map_Kd`) and of a glTF file (the base colour). `read` is asked for the libraries of
/// materials that an OBJ file names, and for nothing else; one that it cannot read becomes a note. Without texture
/// coordinates there are no pictures. O(1) in the points and faces, but the first time for an OBJ file O(its text).
POINTFAIR_EXPORT Texture texture(const Cloud& cloud, const ReadNamed& read);

/// Where the pictures of `texture(cloud, ...)` lie. Throws ErrorKind::file where polygons(cloud) does, or
/// attribute() for texture coordinates of points. O(corners).
POINTFAIR_EXPORT TextureMap texture_map(const Cloud& cloud, const Texture& texture);

}  // namespace pointfair
