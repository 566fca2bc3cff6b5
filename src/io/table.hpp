// SPDX-License-Identifier: Apache-2.0
// A cloud as columns of numbers: what one format hands to another.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/source.hpp"
#include "io/text.hpp"

namespace pointfair::io {

struct TableColumn : Column {
  std::vector<char> data;  ///< size * column_bytes bytes, native byte order
};

struct Table {
  ScalarType coordinate_type = ScalarType::float32;
  std::vector<Position> positions;
  std::vector<TableColumn> columns;
  Faces faces;

  std::size_t size() const { return positions.size(); }
  /// The column called so, or null.
  const TableColumn* find(std::string_view name) const;
};

/// Everything in the cloud that is numbers, under the names that its file uses.
Table make_table(const Cloud& cloud);

/// Gives the columns the names and shapes of PLY: packed colours become red, green, blue, colours are bytes, columns of
/// several components become one each.
void use_ply_names(Table& table);

/// red, green, blue as bytes, colours in 0..1 scaled; false if the table has none.
bool colors_as_bytes(const Table& table, std::vector<std::array<std::uint8_t, 3>>& colors);

/// Calls append_row(i, buffer) for all rows in parallel blocks, and writes the buffers in order.
void write_rows(Output& out, std::size_t rows, const std::function<void(std::size_t, std::string&)>& append_row);

}  // namespace pointfair::io
