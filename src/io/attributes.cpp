// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "io/scalar.hpp"
#include "io/source.hpp"
#include "pointfair/cloud.hpp"
#include "pointfair/file_info.hpp"

namespace pointfair {

std::size_t size_of(ScalarType type) noexcept { return io::size_of(io::native(type)); }

bool takes_attributes(Format format) noexcept {
  return format != Format::off && format != Format::obj && format != Format::e57 && format != Format::ptx &&
         format != Format::stl && format != Format::kitti && format != Format::nuscenes;
}

std::vector<AttributeInfo> attributes(const Cloud& cloud) {
  std::vector<AttributeInfo> result;
  if (cloud.source) {
    for (const io::Column& column : cloud.source->columns()) {
      result.push_back({column.name, io::shown_as(column.type), column.components});
    }
  }
  for (const Attribute& added : cloud.added) {
    const auto own =
        std::find_if(result.begin(), result.end(), [&](const auto& info) { return info.name == added.name; });
    if (own == result.end()) {
      result.push_back(added);
    } else {
      *own = added;
    }
  }
  return result;
}

// 64-bit integers, which the interface does not have, become doubles of the same size.
static void show(io::NativeType type, std::vector<std::byte>& data) {
  if (io::shown_as(type) == static_cast<ScalarType>(type)) return;
  for (std::size_t at = 0; at < data.size(); at += sizeof(double)) {
    char* const value = reinterpret_cast<char*>(data.data() + at);
    io::store_double(value, io::NativeType::float64, false, io::load_double(value, type, false));
  }
}

Attribute attribute(const Cloud& cloud, std::string_view name) {
  const auto added =
      std::find_if(cloud.added.begin(), cloud.added.end(), [&](const auto& a) { return a.name == name; });
  if (added != cloud.added.end()) return *added;
  const std::vector<io::Column> columns = cloud.source ? cloud.source->columns() : std::vector<io::Column>{};
  const auto named = [&](const auto& candidate) { return candidate.name == name; };
  const auto column = std::find_if(columns.begin(), columns.end(), named);
  if (column != columns.end()) {
    Attribute result;
    static_cast<AttributeInfo&>(result) = {column->name, io::shown_as(column->type), column->components};
    result.data.resize(static_cast<std::size_t>(cloud.source->size()) * io::column_bytes(*column));
    cloud.source->extract(static_cast<std::size_t>(column - columns.begin()),
                          {reinterpret_cast<char*>(result.data.data()), result.data.size()});
    show(column->type, result.data);
    return result;
  }
  std::string known;
  for (const AttributeInfo& info : attributes(cloud)) known += (known.empty() ? "" : ", ") + info.name;
  throw Error(ErrorKind::usage,
              "the cloud has no attribute '" + std::string(name) + "'; it has " + (known.empty() ? "none" : known));
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
  Faces faces = cloud.source->faces();
  return {std::move(faces.ends), std::move(faces.corners)};
}

std::vector<std::array<std::uint32_t, 3>> triangles(const Cloud& cloud) {
  std::vector<std::array<std::uint32_t, 3>> result;
  if (!cloud.source) return result;
  const Faces faces = cloud.source->faces();
  std::uint64_t begin = 0;
  for (const std::uint64_t end : faces.ends) {
    for (std::uint64_t c = begin + 2; c < end; ++c) {
      result.push_back({faces.corners[begin], faces.corners[c - 1], faces.corners[c]});
    }
    begin = end;
  }
  return result;
}

}  // namespace pointfair
