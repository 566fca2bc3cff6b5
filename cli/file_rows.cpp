// SPDX-License-Identifier: Apache-2.0
#include "file_rows.hpp"

#include <fmt/format.h>

#include <array>
#include <iterator>
#include <map>

namespace pointfair::cli {
namespace {

// LAS specification 1.4 R15, table 17; 8 and 12 had meanings in the point formats 0 to 5.
constexpr const char* kClasses[] = {"never classified",
                                    "unassigned",
                                    "ground",
                                    "low vegetation",
                                    "medium vegetation",
                                    "high vegetation",
                                    "building",
                                    "low noise",
                                    "model key point",
                                    "water",
                                    "rail",
                                    "road surface",
                                    "overlap",
                                    "wire guard",
                                    "wire conductor",
                                    "transmission tower",
                                    "wire connector",
                                    "bridge deck",
                                    "high noise",
                                    "overhead structure",
                                    "ignored ground",
                                    "snow",
                                    "temporal exclusion"};

using Counts = std::map<unsigned, std::uint64_t>;

// How many points have each value of an attribute of one byte; empty if the cloud has none of this name.
Counts counts_of(const Cloud& cloud, std::string_view name) {
  Counts counts;
  const std::optional<AttributeInfo> info = attribute_info(cloud, name);
  if (!info || info->type != ScalarType::uint8 || info->components != 1) return counts;
  std::array<std::uint64_t, 256> of_value{};
  for (const std::byte value : attribute(cloud, name).data) ++of_value[std::to_integer<unsigned>(value)];
  for (unsigned value = 0; value < of_value.size(); ++value)
    if (of_value[value] > 0) counts[value] = of_value[value];
  return counts;
}

Json counts_json(const Counts& counts) {
  Json json = Json::object();
  for (const auto& [value, count] : counts) json[std::to_string(value)] = count;
  return json;
}

}  // namespace

std::string_view class_name(unsigned value) {
  return value < std::size(kClasses) ? kClasses[value] : value < 64 ? "reserved" : "user-defined";
}

std::string file_text(const Cloud& cloud) {
  const FileInfo info = file_info(cloud);
  std::string text;
  const auto out = std::back_inserter(text);
  for (const auto& [name, value] : info.rows)
    if (!value.empty()) fmt::format_to(out, "  {:<18} {}\n", name, value);
  if (info.grid_width > 0)
    fmt::format_to(out, "  {:<18} {} x {} points, organised\n", "grid", info.grid_width, info.grid_height);
  if (info.metres_per_unit) fmt::format_to(out, "  {:<18} {:.10g} m\n", "unit", *info.metres_per_unit);
  if (info.has_two_units())
    fmt::format_to(out, "  {:<18} {:.10g} m: scale Z before denoising\n", "unit of heights", *info.metres_per_height);
  if (info.is_geographic) fmt::format_to(out, "  {:<18} degrees: project it to metres before denoising\n", "unit");
  if (!text.empty()) text = "file\n" + text;
  const Counts classes = counts_of(cloud, "classification"), returns = counts_of(cloud, "return_number");
  if (!classes.empty()) fmt::format_to(out, "classes\n");
  for (const auto& [value, count] : classes)
    fmt::format_to(out, "  {:<3} {:<18} {}\n", value, class_name(value), count);
  if (!returns.empty()) fmt::format_to(out, "returns\n");
  for (const auto& [value, count] : returns) fmt::format_to(out, "  {:<22} {}\n", value, count);
  return text;
}

Json file_json(const Cloud& cloud) {
  const FileInfo info = file_info(cloud);
  Json json = Json::object();
  for (const auto& [name, value] : info.rows) json[name] = value;
  if (info.grid_width > 0) json["grid"] = {info.grid_width, info.grid_height};
  json["metres_per_unit"] = info.metres_per_unit ? Json(*info.metres_per_unit) : Json(nullptr);
  json["metres_per_height"] = info.metres_per_height ? Json(*info.metres_per_height) : json["metres_per_unit"];
  json["geographic"] = info.is_geographic;
  json["step"] = info.step;
  json["classes"] = counts_json(counts_of(cloud, "classification"));
  json["returns"] = counts_json(counts_of(cloud, "return_number"));
  return json;
}

}  // namespace pointfair::cli
