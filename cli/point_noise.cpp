// SPDX-License-Identifier: Apache-2.0
#include "point_noise.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <optional>

namespace pointfair::cli {
namespace {

constexpr std::size_t kLongestName = 32;  // of extra bytes in LAS

// Lengths begin with a digit or a sign.
bool is_name(const std::string& text) {
  return text != "auto" && (std::isalpha(static_cast<unsigned char>(text[0])) || text[0] == '_');
}

// Those that a noise can be read from.
std::string scalar_names(const Cloud& cloud) {
  std::string names;
  for (const AttributeInfo& info : attributes(cloud))
    if (info.components == 1) names += (names.empty() ? "" : ", ") + info.name;
  return names.empty() ? "none" : names;
}

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorKind::usage, message); }

}  // namespace

std::string take_noise_attribute(ParamArguments& params) {
  const auto its = std::ranges::find_if(params.given, [](const auto& given) { return given.first->name == "noise"; });
  if (its == params.given.end() || its->second.empty() || !is_name(its->second)) return {};
  const std::string name = its->second;
  params.given.erase(its);
  return name;
}

void use_noise_attribute(const Cloud& cloud, const std::string& name, const std::string& input, Pipeline& pipeline) {
  const std::optional<AttributeInfo> info = meant_attribute(cloud, name);
  if (!info || info->components != 1)
    refuse(
        fmt::format("--noise {}: {} has no attribute '{}' of one number a point; it has {}. Name one of them, or give "
                    "a length",
                    name, input, name, scalar_names(cloud)));
  const Attribute given = attribute(cloud, info->name);
  std::vector<float> values(cloud.points.size());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(value_at(given, i));
  if (std::ranges::none_of(values, [](float value) { return value > 0; }))
    refuse(
        fmt::format("--noise {}: no value of this attribute in {} is positive, so none is a standard deviation; name "
                    "another, or give a length",
                    name, input));
  pipeline.set_noise(values);
}

void check_new_attribute(const Cloud& cloud, const std::string& flag, const std::string& name,
                         const WriteOptions& options) {
  const auto is_part_of_name = [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == '.'; };
  const bool is_coordinate = name == "x" || name == "y" || name == "z" || name == "X" || name == "Y" || name == "Z";
  if (name.empty() || name.size() > kLongestName || is_coordinate || !std::ranges::all_of(name, is_part_of_name))
    refuse(fmt::format(
        "{}={}: a name has up to {} letters, digits, '_', '-' and '.', and is no coordinate; choose another", flag,
        name.substr(0, 60), kLongestName));
  const std::optional<Format> format = options.format ? options.format : file_info(cloud).format;
  const bool is_new_e57 = format == Format::e57 && file_info(cloud).format != Format::e57;
  if (format && !takes_attributes(*format) && !is_new_e57)
    refuse(flag + ": files of this format take no further attributes; write PLY, PCD, LAS, LAZ or text");
  const std::optional<AttributeInfo> info = attribute_info(cloud, name);
  const bool is_float = info && !is_stored_scaled(cloud, name) &&
                        (info->type == ScalarType::float32 || info->type == ScalarType::float64);
  if (info && (info->components != 1 || !is_float))
    refuse(fmt::format(
        "{}: the cloud has an attribute '{}' of its own that is not stored as a float; name another, as in {}={}_2",
        flag, name, flag, name.substr(0, kLongestName - 2)));
}

namespace {

// Adds an attribute, in place of an added one of this name.
void add_floats(const std::string& name, std::span<const float> values, Cloud& cloud) {
  std::erase_if(cloud.added, [&](const Attribute& other) { return other.name == name; });
  Attribute& attribute = cloud.added.emplace_back();
  attribute.name = name;
  const auto bytes = std::as_bytes(values);
  attribute.data.assign(bytes.begin(), bytes.end());
}

}  // namespace

void write_noise_attribute(Pipeline& pipeline, const Params& params, const std::string& name, std::stop_token stop,
                           Cloud& cloud) {
  std::vector<float> values(cloud.points.size());
  pipeline.noise(values, params, stop);
  add_floats(name, values, cloud);
}

void displacements(const Cloud& before, const Cloud& after, std::span<double> out) {
  std::vector<Position> from, to;
  if (after.source != before.source) {
    from.resize(out.size());
    to.resize(out.size());
    positions(before, from);
    positions(after, to);
  }
  tbb::parallel_for(std::size_t(0), out.size(), [&](std::size_t i) {
    const Point &p = before.points[i], &q = after.points[i];
    out[i] = from.empty() ? std::hypot(double{q.x} - p.x, double{q.y} - p.y, double{q.z} - p.z)
                          : std::hypot(to[i][0] - from[i][0], to[i][1] - from[i][1], to[i][2] - from[i][2]);
  });
}

void write_displacement_attribute(const Cloud& before, const std::string& name, Cloud& cloud) {
  std::vector<double> lengths(cloud.points.size());
  displacements(before, cloud, lengths);
  std::vector<float> values;
  for (const double length : lengths)
    values.push_back(std::isfinite(length) ? static_cast<float>(length) : std::numeric_limits<float>::quiet_NaN());
  add_floats(name, values, cloud);
}

}  // namespace pointfair::cli
