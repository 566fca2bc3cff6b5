// SPDX-License-Identifier: Apache-2.0
// A new PLY file from a table.
#include <algorithm>
#include <cmath>
#include <span>

#include "io/column_names.hpp"
#include "io/formats.hpp"
#include "io/ply_body.hpp"
#include "io/ply_header.hpp"

namespace pointfair::io {
namespace {

// Most readers expect a face as a list of uchar and int; larger files need more.
struct FaceTypes {
  NativeType count = NativeType::uint8, corner = NativeType::int32;
};

FaceTypes face_types(const Table& table) {
  std::size_t longest = 0;
  for (std::size_t face = 0; face < table.faces.ends.size(); ++face)
    longest = std::max(longest, table.faces.corners_of(face).size());
  const std::size_t most = table.faces.texture.empty() ? 255 : 255 / 2;
  if (longest <= most && table.size() < (std::uint64_t{1} << 31)) return {};
  return {NativeType::uint32, NativeType::uint32};
}

std::string new_header(const Table& table, Encoding encoding) {
  std::vector<AttributeInfo> properties;
  for (const char* axis : {"x", "y", "z"}) properties.push_back({axis, table.coordinate_type, 1});
  for (const TableColumn& column : table.columns) properties.push_back({column.name, shown_as(column.type), 1});
  std::string header = "ply\nformat " + std::string(ply_encoding_name(encoding)) + " 1.0\n";
  header += "element vertex " + std::to_string(table.size()) + "\n" + ply_property_lines(properties, "\n");
  if (!table.faces.ends.empty()) {
    header += "element face " + std::to_string(table.faces.ends.size()) + "\n";
    header += face_types(table).count == NativeType::uint8 ? "property list uchar int" : "property list uint uint";
    header += " vertex_indices\n";
    if (!table.faces.texture.empty())
      header += face_types(table).count == NativeType::uint8 ? "property list uchar float texcoord\n"
                                                             : "property list uint float texcoord\n";
  }
  return header + "end_header\n";
}

}  // namespace

void write_ply(Table table, const Writing& writing, Output& out) {
  use_ply_names(table);
  use_words_as_names(table);
  out.write(new_header(table, writing.encoding));
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    PlyEmitter emitter(buffer, writing.encoding);
    for (const double value : table.positions[i]) emitter.put(value, native(table.coordinate_type));
    for (const TableColumn& column : table.columns) emitter.put(column.value(i), native(shown_as(column.type)));
    emitter.end_row();
  });
  const FaceTypes types = face_types(table);
  write_rows(out, table.faces.ends.size(), [&](std::size_t face, std::string& buffer) {
    const std::span<const std::uint32_t> corners = table.faces.corners_of(face);
    PlyEmitter emitter(buffer, writing.encoding);
    emitter.put(static_cast<double>(corners.size()), types.count);
    for (const std::uint32_t corner : corners) emitter.put(corner, types.corner);
    if (!table.faces.texture.empty()) {
      const auto texture = std::span(table.faces.texture).subspan(2 * table.faces.begin_of(face), 2 * corners.size());
      const bool has_none = std::ranges::all_of(texture, [](float value) { return std::isnan(value); });
      emitter.put(has_none ? 0.0 : static_cast<double>(texture.size()), types.count);
      if (!has_none)
        for (const float value : texture) emitter.put(value, NativeType::float32);
    }
    emitter.end_row();
  });
}

}  // namespace pointfair::io
