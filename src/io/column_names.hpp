// SPDX-License-Identifier: Apache-2.0
// How the formats call the same attributes.
#pragma once

#include <cstdint>
#include <functional>
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

/// What a new file calls its columns, each another way.
struct NewNames {
  std::vector<std::string> names;    ///< of the columns, in their order
  std::vector<std::string> renamed;  ///< columns that get neither their own name nor that of the format
};

/// `own` gives the name that the format has for a column, or an empty one; `valid` makes a name one that the format can
/// have. Columns with a name of the format come first where several are called so, then those whose name is valid;
/// `taken`, what else the file holds, comes before all of them.
NewNames new_names(const std::vector<std::string>& columns, std::vector<std::string> taken,
                   const std::function<std::string(const std::string& column)>& own,
                   const std::function<std::string(const std::string& column)>& valid = one_word);

/// The names in files that name their columns by single words and have none of their own beside x, y and z: PLY, text.
NewNames word_names(const std::vector<std::string>& columns);

}  // namespace pointfair::io
