// SPDX-License-Identifier: Apache-2.0
// The header of a PCD file, versions 0.5 to 0.7 (pointclouds.org, "The PCD (Point Cloud Data) file format").
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/source.hpp"
#include "pointfair/io.hpp"

namespace pointfair::io {

struct PcdHeader {
  Encoding encoding = Encoding::ascii;
  std::vector<Column> fields;
  std::array<std::size_t, 3> xyz{};  ///< which fields are the coordinates
  std::uint64_t width = 0, height = 1;
  char line_end = '\n';
  std::uint64_t others = 0;  ///< lines that are comments, or that PCD does not know
  std::string viewpoint = "0 0 0 1 0 0 0";
  std::string text;  ///< the header itself, up to and including the line end of DATA
  // Where `text` takes further fields: the ends of these lines; 0 for COUNT where there is none.
  std::size_t fields_end = 0, sizes_end = 0, types_end = 0, counts_end = 0;

  std::uint64_t points() const { return width * height; }
  std::size_t record_size() const;
};

/// A field that only fills space.
inline bool is_padding(const Column& field) { return field.name == "_"; }

/// Reads the header at the front of `file`. Throws Error(file) in the name of `name`.
PcdHeader parse_pcd_header(std::string_view file, const std::string& name);

/// The header's text with further fields.
std::string pcd_header_text(const PcdHeader& header, const AddedAttributes& added);

/// The header's text for so many points in one row.
std::string pcd_header_of(std::string_view text, char line_end, std::uint64_t points);

/// A header for these fields.
std::string new_pcd_header(const std::vector<Column>& fields, std::uint64_t width, std::uint64_t height,
                           const std::string& viewpoint, Encoding encoding);

}  // namespace pointfair::io
