// SPDX-License-Identifier: Apache-2.0
#include "io/column_names.hpp"

#include <array>
#include <utility>

#include "io/text.hpp"

namespace pointfair::io {

std::vector<std::string> component_names(const std::string& name, std::uint32_t components) {
  if (components == 1) return {name};
  if (components == 3 && (name == "normal" || name == "normals")) return {"nx", "ny", "nz"};
  std::vector<std::string> names;
  for (std::uint32_t c = 0; c < components; ++c) names.push_back(name + "_" + std::to_string(c));
  return names;
}

std::string one_word(std::string_view name) {
  std::string word(name);
  for (char& c : word)
    if (c == ' ' || c == ',' || c == ';' || static_cast<unsigned char>(c) < 32) c = '_';
  return word.empty() ? "unnamed" : word;
}

std::string ply_name(const std::string& name) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 23> kAliases = {{
      {"normal_x", "nx"},
      {"normal_y", "ny"},
      {"normal_z", "nz"},
      {"nx", "nx"},
      {"ny", "ny"},
      {"nz", "nz"},
      {"r", "red"},
      {"g", "green"},
      {"b", "blue"},
      {"rf", "red"},  // CloudCompare, for colours from 0 to 1
      {"gf", "green"},
      {"bf", "blue"},
      {"a", "alpha"},
      {"red", "red"},
      {"green", "green"},
      {"blue", "blue"},
      {"alpha", "alpha"},
      {"colorred", "red"},  // E57
      {"colorgreen", "green"},
      {"colorblue", "blue"},
      {"nor:normalx", "nx"},
      {"nor:normaly", "ny"},
      {"nor:normalz", "nz"},
  }};
  const std::string lower = lower_case(name);
  for (const auto& [alias, plain] : kAliases)
    if (lower == alias) return std::string(plain);
  return name;
}

}  // namespace pointfair::io
