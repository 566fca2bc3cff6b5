// SPDX-License-Identifier: Apache-2.0
#include "io/column_names.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "io/coordinate_names.hpp"
#include "io/text.hpp"
#include "pointfair/io.hpp"

namespace pointfair {
namespace io {

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
    if (c == ' ' || c == ',' || c == ';' || c == '"' || static_cast<unsigned char>(c) < 32) c = '_';
  return word.empty() ? "unnamed" : word;
}

std::string ply_name(const std::string& name) {
  // each with its other names: of programs, of colours from 0 to 1 as CloudCompare has them, and of E57
  static constexpr std::array<std::string_view, 4> kNames[] = {{"nx", "normal_x", "nor:normalx"},
                                                               {"ny", "normal_y", "nor:normaly"},
                                                               {"nz", "normal_z", "nor:normalz"},
                                                               {"red", "r", "rf", "colorred"},
                                                               {"green", "g", "gf", "colorgreen"},
                                                               {"blue", "b", "bf", "colorblue"},
                                                               {"alpha", "a"}};
  const std::string lower = lower_case(name);
  for (const auto& names : kNames)
    if (!lower.empty() && std::ranges::find(names, lower) != names.end()) return std::string(names[0]);
  return name;
}

NewNames new_names(const std::vector<std::string>& columns, std::vector<std::string> taken,
                   const std::function<std::string(const std::string& column)>& own,
                   const std::function<std::string(const std::string& column)>& valid) {
  std::vector<std::size_t> order(columns.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t column) {
    return !own(columns[column]).empty() ? 0 : valid(columns[column]) == columns[column] ? 1 : 2;
  });
  const auto wanted = [&](std::size_t column, const std::string& without_own) {
    const std::string its = own(columns[column]);
    return its.empty() ? without_own : its;
  };
  std::vector<std::string>& all = taken;
  const std::size_t first = all.size();
  for (const std::size_t column : order) all.push_back(wanted(column, valid(columns[column])));
  make_distinct(all);
  NewNames result{std::vector<std::string>(columns.size()), {}};
  for (std::size_t i = 0; i < order.size(); ++i) {
    result.names[order[i]] = all[first + i];
    if (all[first + i] != wanted(order[i], columns[order[i]])) result.renamed.push_back(columns[order[i]]);
  }
  return result;
}

NewNames word_names(const std::vector<std::string>& columns) {
  return new_names(columns, {"x", "y", "z"}, [](const std::string&) { return std::string(); });
}

}  // namespace io

std::string las_name(std::string_view name) {
  static constexpr std::array<std::string_view, 15> kNames = {
      {"intensity", "return_number", "number_of_returns", "scan_direction_flag", "edge_of_flight_line",
       "classification", "synthetic", "key_point", "withheld", "overlap", "scanner_channel", "user_data",
       "point_source_id", "gps_time", "nir"}};
  const auto plain = [](std::string_view text) {
    std::string letters = io::lower_case(text);
    std::erase_if(letters, [](char c) { return c == '_' || c == ' '; });
    return letters;
  };
  const std::string letters = plain(name);
  if (letters == "scanchannel") return "scanner_channel";  // both of PDAL
  if (letters == "infrared") return "nir";
  const auto* const its = std::ranges::find(kNames, letters, plain);
  return std::string(its == kNames.end() ? name : *its);
}

}  // namespace pointfair
