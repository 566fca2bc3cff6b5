// SPDX-License-Identifier: Apache-2.0
// The rows of a PLY file's faces, edges and other elements, in any encoding, where points may be left out of the file.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/output.hpp"
#include "io/ply_body.hpp"
#include "io/ply_faces.hpp"

namespace pointfair::io {

/// Whether nothing but faces and edges names points, as far as names and types of properties tell.
bool can_lose_points(const PlyFile& file);

/// Copies one value, with all its digits.
void copy_value(PlyCursor& cursor, NativeType type, PlyEmitter& emitter);

/// Copies one row, but values for which replace(property) is true: it has put another one.
template <class Replace>
void copy_row(PlyCursor& cursor, const PlyElement& element, PlyEmitter& emitter, const Replace& replace) {
  cursor.begin_row();
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    std::uint64_t count = 1;
    if (property.list_count) {
      count = cursor.next_list_size(property);
      emitter.put(static_cast<double>(count), *property.list_count);
    }
    for (; count > 0; --count)
      if (!replace(p)) copy_value(cursor, property.type, emitter);
  }
}

class PlyRows {
 public:
  /// Without the points of which `removed` is not 0; empty: with all. Then takes 4 bytes a point.
  PlyRows(const PlyFile& file, std::string_view bytes, const std::string& name, std::span<const std::uint8_t> removed);

  /// The rows that each element has left: faces and edges go with any of their points. Walks along those.
  std::vector<std::uint64_t> counts() const;
  /// Writes the rows of an element that is not the points; what names points does so by their new numbers. Throws
  /// Error(file) for one that is not there.
  void write(std::size_t element, Encoding encoding, Output& out) const;

 private:
  template <class Take>
  void for_pieces(std::size_t element, Encoding encoding, const Take& take) const;
  bool copy_point(PlyCursor& cursor, std::size_t element, NativeType type, PlyEmitter& emitter) const;

  const PlyFile& file_;
  std::string_view bytes_;
  const std::string& name_;
  std::vector<std::uint32_t> now_;  // of each point its number, or that it is gone; empty: nothing is gone
  std::vector<std::vector<bool>> names_a_point_;  // of each element each property
};

}  // namespace pointfair::io
