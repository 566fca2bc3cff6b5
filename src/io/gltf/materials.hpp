// SPDX-License-Identifier: Apache-2.0
// The materials of a glTF file.
#pragma once

#include "io/gltf/document.hpp"
#include "io/materials.hpp"

namespace pointfair::io::gltf {

/// Each with the picture of its base colour, if it has one. Never fails: of a material that is damaged, or asks for
/// what is not known, a note says so.
Materials materials_of(const Document& document);

}  // namespace pointfair::io::gltf
