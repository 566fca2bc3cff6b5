// SPDX-License-Identifier: Apache-2.0
// The header of a PLY file (Greg Turk, "The PLY Polygon File Format", 1994; type names as in its later variants).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/edits.hpp"
#include "io/scalar.hpp"
#include "pointfair/io.hpp"

namespace pointfair::io {

struct PlyProperty {
  std::string name;
  NativeType type = NativeType::float32;
  std::optional<NativeType> list_count;  ///< a list: the type of its count
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  Encoding encoding = Encoding::ascii;
  std::vector<PlyElement> elements;
  std::string text;  ///< the header itself, up to and including its last line end
  char line_end = '\n';
  std::uint64_t comments = 0;         ///< lines of them
  std::vector<std::string> textures;  ///< images that a comment names
  std::size_t vertex = 0;             ///< which element the points are
  std::size_t encoding_at = 0;        ///< where `text` names the encoding
  std::size_t properties_end = 0;     ///< where `text` takes further properties of the points
};

/// Reads the header at the front of `file`. Throws Error(file) in the name of `name`.
PlyHeader parse_ply_header(std::string_view file, const std::string& name);

/// The word for an encoding in the "format" line.
std::string_view ply_encoding_name(Encoding encoding);

/// Property lines for attributes of `components` values each.
std::string ply_property_lines(const std::vector<AttributeInfo>& attributes, std::string_view line_end);

/// The header's text for another encoding, with further properties of the points.
std::string ply_header_text(const PlyHeader& header, Encoding encoding, const AddedAttributes& added);

/// The same text with other numbers of rows, one for each element.
std::string ply_header_with(const std::vector<std::uint64_t>& counts, std::string_view text, const PlyHeader& header);

/// Which property of an element is called so, in small letters or others; the number of properties if none is.
std::size_t find_property(const PlyElement& element, std::string_view name);

/// Bytes of a record in binary; nothing if it has a list.
std::optional<std::size_t> record_size(const PlyElement& element);

}  // namespace pointfair::io
