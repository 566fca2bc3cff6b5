// SPDX-License-Identifier: Apache-2.0
// What of a cloud a file of another format does not keep.
#include <algorithm>
#include <array>
#include <initializer_list>
#include <utility>

#include "io/column_names.hpp"
#include "io/formats.hpp"
#include "io/source.hpp"
#include "pointfair/io.hpp"

namespace pointfair {
namespace {

bool is_one_of(const std::string& name, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool is_color(const std::string& name) { return is_one_of(name, {"red", "green", "blue", "rgb", "rgba"}); }

// Whether the writer of a new file of the format has a place for it.
bool is_kept(Format format, const AttributeInfo& attribute) {
  const std::vector<std::string> parts = io::component_names(attribute.name, attribute.components);
  return std::all_of(parts.begin(), parts.end(), [&](const std::string& part) {
    const std::string name = io::ply_name(part);
    if (format == Format::stl) return false;
    return is_color(name) || (format == Format::off && is_one_of(name, {"nx", "ny", "nz"})) ||
           (format == Format::ptx && name == "intensity");
  });
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// A copy of the cloud's file has its own attributes in any case.
std::vector<AttributeInfo> written_anew(const Cloud& cloud, Format format) {
  if (!cloud.source || cloud.source->format() != format) return attributes(cloud);
  return {cloud.added.begin(), cloud.added.end()};
}

std::vector<std::string> lost_attributes(const Cloud& cloud, Format format) {
  const bool is_nameless = format == Format::xyz || format == Format::pts;
  static constexpr std::array<std::pair<Format, const char*>, 4> kFew = {
      {{Format::obj, "OBJ"}, {Format::off, "OFF"}, {Format::ptx, "PTX"}, {Format::stl, "STL"}}};
  const auto* const few = std::find_if(kFew.begin(), kFew.end(), [&](const auto& row) { return row.first == format; });
  if (!is_nameless && few == kFew.end()) return {};
  std::vector<std::string> lost;
  for (const AttributeInfo& attribute : written_anew(cloud, format))
    if (is_nameless || !is_kept(format, attribute)) lost.push_back(attribute.name);
  if (lost.empty()) return {};
  if (is_nameless)
    return {"XYZ and PTS files do not name their columns, so the attributes " + listed(lost) +
            " stand there without their names; CSV, PLY and PCD keep them"};
  return {std::string(few->second) + " files have no place for the attributes " + listed(lost) +
          "; PLY, PCD and CSV keep them"};
}

}  // namespace

std::vector<std::string> losses(const Cloud& cloud, std::optional<Format> format) {
  if (!cloud.source && !format) return {};
  const Format to = format ? *format : cloud.source->format();
  std::vector<std::string> result = cloud.source ? cloud.source->losses(to) : std::vector<std::string>{};
  for (std::string& lost : lost_attributes(cloud, to)) result.push_back(std::move(lost));
  if (to == Format::copc)
    result.push_back("COPC files keep their points in the order of an octree, so the order of the points changes");
  const bool is_new_stl = to == Format::stl && (!cloud.source || cloud.source->format() != to);
  if (is_new_stl)
    for (std::string& lost : io::losses_in_new_stl(cloud)) result.push_back(std::move(lost));
  return result;
}

}  // namespace pointfair
