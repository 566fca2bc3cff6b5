// SPDX-License-Identifier: Apache-2.0
// How the formats call the same attributes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace pointfair::io {

/// Names for an attribute's components where a format has scalars only: "normal" becomes nx, ny, nz; others are
/// numbered.
std::vector<std::string> component_names(const std::string& name, std::uint32_t components);

/// The name without what would end a word in a header.
std::string one_word(std::string_view name);

/// The name as PLY files have it: "normal_x" and "Nx" are nx, "R" is red; others as they are.
std::string ply_name(const std::string& name);

}  // namespace pointfair::io
