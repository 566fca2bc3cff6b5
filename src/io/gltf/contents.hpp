// SPDX-License-Identifier: Apache-2.0
// What a glTF file holds beside the meshes of its scene and their points, normals, colours and texture coordinates, and
// its materials.
#pragma once

#include <vector>

#include "io/contents.hpp"
#include "io/gltf/document.hpp"
#include "io/materials.hpp"

namespace pointfair::io::gltf {

/// The attributes of points that are read; all others are told by further_contents().
inline constexpr const char* kReadAttributes[] = {"POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0"};

/// One content for each further kind of thing. `visited`: which nodes belong to the scene. Throws as Json does.
std::vector<Content> further_contents(const Json& document, const std::vector<bool>& visited);

/// Each with the picture of its base colour, if it has one. Never fails: of a material that is damaged, or asks for
/// what is not known, a note says so.
Materials materials_of(const Document& document);

}  // namespace pointfair::io::gltf
