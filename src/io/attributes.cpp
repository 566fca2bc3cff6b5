// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "io/scalar.hpp"
#include "io/source.hpp"
#include "io/text.hpp"
#include "pointfair/cloud.hpp"
#include "pointfair/file_info.hpp"

namespace pointfair {

std::size_t size_of(ScalarType type) noexcept { return io::size_of(io::native(type)); }

bool takes_attributes(Format format) noexcept {
  return format != Format::off && format != Format::obj && format != Format::e57 && format != Format::ptx &&
         format != Format::stl && format != Format::kitti && format != Format::nuscenes;
}

template <class All>
static auto find_named(All& all, std::string_view name) {
  return std::ranges::find_if(all, [&](const auto& candidate) { return candidate.name == name; });
}

bool is_stored_scaled(const Cloud& cloud, std::string_view name) {
  const std::vector<io::Column> columns = cloud.source ? cloud.source->columns() : std::vector<io::Column>{};
  const auto its = find_named(columns, name);
  return its != columns.end() && its->scaled;
}

std::vector<AttributeInfo> attributes(const Cloud& cloud) {
  std::vector<AttributeInfo> result;
  if (cloud.source) {
    for (const io::Column& column : cloud.source->columns())
      result.push_back({column.name, io::shown_as(column.type), column.components});
  }
  for (const Attribute& added : cloud.added) {
    const auto own = find_named(result, added.name);
    if (own == result.end()) {
      result.push_back(added);
    } else {
      *own = added;
    }
  }
  return result;
}

std::optional<AttributeInfo> attribute_info(const Cloud& cloud, std::string_view name) {
  const std::vector<AttributeInfo> all = attributes(cloud);
  const auto its = find_named(all, name);
  return its == all.end() ? std::nullopt : std::optional(*its);
}

std::optional<AttributeInfo> meant_attribute(const Cloud& cloud, std::string_view name) {
  if (std::optional<AttributeInfo> its = attribute_info(cloud, name)) return its;
  const std::vector<AttributeInfo> all = attributes(cloud);
  const auto only = [&](const auto& is_it) -> std::optional<AttributeInfo> {
    if (std::ranges::count_if(all, is_it) != 1) return std::nullopt;
    return *std::ranges::find_if(all, is_it);
  };
  const std::string lower = io::lower_case(name), of_las = las_name(name);
  if (auto its = only([&](const AttributeInfo& info) { return io::lower_case(info.name) == lower; })) return its;
  return only([&](const AttributeInfo& info) { return las_name(info.name) == of_las; });
}

// 64-bit integers, which the interface does not have, become doubles of the same size.
static void show(io::NativeType type, std::vector<std::byte>& data) {
  if (io::shown_as(type) == static_cast<ScalarType>(type)) return;
  for (std::size_t at = 0; at < data.size(); at += sizeof(double)) {
    char* const value = reinterpret_cast<char*>(data.data() + at);
    io::store_double(value, io::NativeType::float64, false, io::load_double(value, type, false));
  }
}

[[noreturn]] static void fail_without(const Cloud& cloud, std::string_view name) {
  std::string known;
  for (const AttributeInfo& info : attributes(cloud)) known += (known.empty() ? "" : ", ") + info.name;
  throw Error(ErrorKind::usage,
              "the cloud has no attribute '" + std::string(name) + "'; it has " + (known.empty() ? "none" : known));
}

Attribute attribute(const Cloud& cloud, std::string_view name) {
  const std::string names[] = {std::string(name)};
  return std::move(attribute_values(cloud, names).front());
}

std::vector<Attribute> attribute_values(const Cloud& cloud, std::span<const std::string> names) {
  if (!cloud.points.empty()) io::check_has_points_of_file(cloud);
  const std::vector<io::Column> columns = cloud.source ? cloud.source->columns() : std::vector<io::Column>{};
  constexpr std::size_t kAdded = static_cast<std::size_t>(-1);
  std::vector<Attribute> result(names.size());
  std::vector<std::size_t> columns_of(names.size(), kAdded);
  std::vector<std::span<char>> places(columns.size());
  for (std::size_t n = 0; n < names.size(); ++n) {
    const auto added = find_named(cloud.added, names[n]);
    if (added != cloud.added.end()) {
      result[n] = *added;
      continue;
    }
    const auto column = find_named(columns, names[n]);
    if (column == columns.end()) fail_without(cloud, names[n]);
    columns_of[n] = static_cast<std::size_t>(column - columns.begin());
    result[n] = {{column->name, io::shown_as(column->type), column->components}, {}};
    if (!places[columns_of[n]].empty()) continue;  // named before
    std::vector<std::byte>& data = result[n].data;
    data.resize(static_cast<std::size_t>(cloud.source->size()) * io::column_bytes(*column));
    places[columns_of[n]] = {reinterpret_cast<char*>(data.data()), data.size()};
  }
  if (cloud.source) cloud.source->extract_several(places);
  for (std::size_t n = 0; n < names.size(); ++n) {
    if (columns_of[n] == kAdded) continue;
    const auto first = std::ranges::find(columns_of, columns_of[n]);
    const auto same = static_cast<std::size_t>(first - columns_of.begin());
    if (same == n) {
      show(columns[columns_of[n]].type, result[n].data);
    } else {
      result[n].data = result[same].data;
    }
  }
  return result;
}

double value_at(const Attribute& attribute, std::size_t point, std::uint32_t component) noexcept {
  const std::size_t index = point * attribute.components + component;
  const auto* const from = reinterpret_cast<const char*>(attribute.data.data()) + index * size_of(attribute.type);
  return io::load_double(from, io::native(attribute.type), false);
}

FileInfo file_info(const Cloud& cloud) {
  if (!cloud.source) return {};
  FileInfo info = cloud.source->info();
  info.format = cloud.source->format();
  return info;
}

void check_not_geographic(const Cloud& cloud) {
  if (cloud.source) io::check_not_geographic(*cloud.source);
}

Polygons polygons(const Cloud& cloud) {
  if (!cloud.source) return {};
  io::FaceCollector collector;
  cloud.source->visit_faces(collector);
  Faces faces = std::move(collector).finish();
  return {std::move(faces.ends), std::move(faces.corners)};
}

std::vector<std::array<std::uint32_t, 3>> triangles(const Cloud& cloud) {
  io::TriangleCollector collector;
  if (cloud.source) cloud.source->visit_faces(collector);
  return std::move(collector).finish();
}

}  // namespace pointfair
