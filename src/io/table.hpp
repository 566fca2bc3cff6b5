// SPDX-License-Identifier: Apache-2.0
// A cloud as columns of numbers: what one format hands to another.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/source.hpp"
#include "io/text.hpp"

namespace pointfair::io {

struct TableColumn : Column {
  std::vector<char> data;  ///< size * column_bytes bytes, native byte order

  /// Of all rows, where there is one component.
  std::size_t value_count() const { return data.size() / size_of(type); }
  double value(std::size_t row) const { return load_double(data.data() + row * size_of(type), type, false); }
};

/// Gives the column another type, and the values of(row, value).
template <class Of>
void change_values(TableColumn& column, NativeType type, const Of& of) {
  std::vector<char> data(column.value_count() * size_of(type));
  for (std::size_t i = 0; i < column.value_count(); ++i)
    store_double(data.data() + i * size_of(type), type, false, of(i, column.value(i)));
  column.type = type;
  column.data = std::move(data);
}

/// The attribute as a column, and a column of zeros for so many rows.
TableColumn column_of(const Attribute& attribute);
TableColumn zero_column(Column column, std::size_t rows);

struct Table {
  ScalarType coordinate_type = ScalarType::float32;
  std::vector<Position> positions;
  std::vector<TableColumn> columns;
  Faces faces;

  std::size_t size() const { return positions.size(); }
  /// The column called so, or null.
  const TableColumn* find(std::string_view name) const;
  /// Those called so, in this order; none if one is missing.
  std::vector<const TableColumn*> find_all(std::span<const std::string_view> names) const;
};

/// As another file gets them: (0, 0, 0) where an image of points has it, which is not finite for a run.
std::vector<Position> written_positions(const Cloud& cloud);

/// Everything in the cloud that is numbers, under the names that its file uses.
Table make_table(const Cloud& cloud);

/// How fine colours may be: bytes, 16 bits, or as they are.
enum class ColorDepth : std::uint8_t { bytes, sixteen_bits, any };

/// Gives the columns the names and shapes of PLY: packed colours become red, green, blue, colours are bytes, columns of
/// several components become one each.
void use_ply_names(Table& table, ColorDepth depth = ColorDepth::bytes);

/// Gives the columns names of one word, no two of them the same.
void use_words_as_names(Table& table);

/// What use_ply_names() calls the columns of make_table(); and those of a table.
std::vector<std::string> ply_names(const Cloud& cloud);
std::vector<std::string> names_of(const Table& table);

/// Of normals, as use_ply_names() has them.
inline constexpr std::array<std::string_view, 3> kNormals = {"nx", "ny", "nz"};

/// A row's coordinates and its value of a column as words of a text, each with the separator behind it.
void append_position(std::string& to, const Table& table, std::size_t row, char separator);
void append_value(std::string& to, const TableColumn& column, std::size_t row, char separator);

/// Calls append_row(i, buffer) for all rows in parallel blocks, and writes the buffers in order.
void write_rows(Output& out, std::size_t rows, const std::function<void(std::size_t, std::string&)>& append_row);

}  // namespace pointfair::io
