// SPDX-License-Identifier: Apache-2.0
#include "io/table.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "io/colors.hpp"
#include "io/column_names.hpp"
#include "io/coordinate_names.hpp"
#include "io/parallel.hpp"

namespace pointfair::io {
namespace {

constexpr std::size_t kRowsPerBlock = 8192;

// Splits a column into one for each component.
void split_components(const TableColumn& column, std::vector<TableColumn>& to) {
  const std::size_t size = size_of(column.type), stride = column_bytes(column), rows = column.data.size() / stride;
  const auto names = component_names(column.name, column.components);
  for (std::size_t c = 0; c < names.size(); ++c) {
    TableColumn part = zero_column({names[c], column.type}, rows);
    for (std::size_t i = 0; i < rows; ++i)
      std::memcpy(part.data.data() + i * size, column.data.data() + i * stride + c * size, size);
    to.push_back(std::move(part));
  }
}

// PCD packs colours into the four bytes of one number, 0xAARRGGBB.
void split_packed_color(const TableColumn& column, std::vector<TableColumn>& to) {
  static constexpr const char* kNames[] = {"red", "green", "blue", "alpha"};
  static constexpr int kShifts[] = {16, 8, 0, 24};
  const std::size_t rows = column.data.size() / 4;
  for (std::size_t c = 0; c < (column.name == "rgba" ? 4U : 3U); ++c) {
    TableColumn part = zero_column({kNames[c], NativeType::uint8}, rows);
    for (std::size_t i = 0; i < rows; ++i)
      part.data[i] = static_cast<char>(load<std::uint32_t>(column.data.data() + 4 * i, false) >> kShifts[c] & 255);
    to.push_back(std::move(part));
  }
}

// CloudCompare calls colours from 0 to 1 so. Whole numbers among them are 0 or 1.
bool is_unit_color(const TableColumn& column) {
  const std::string name = lower_case(column.name);
  return is_integer(column.type) && (name == "rf" || name == "gf" || name == "bf");
}

// Whether the columns have all three channels of a colour, by any of their names.
bool has_all_channels(const std::vector<TableColumn>& columns) {
  return std::ranges::all_of(kChannels, [&](std::string_view channel) {
    return std::ranges::any_of(columns, [&](const TableColumn& column) { return ply_name(column.name) == channel; });
  });
}

// The names of PLY, where no other column has them. One letter, as b, is a colour beside the others only.
void rename_columns(std::vector<TableColumn>& columns) {
  const bool has_channels = has_all_channels(columns);
  std::vector<std::string> names;
  std::ranges::transform(columns, std::back_inserter(names), &TableColumn::name);
  for (std::string& name : names) {
    const std::string plain = ply_name(name);
    if ((has_channels || name.size() > 1) && std::ranges::find(names, plain) == names.end()) name = plain;
  }
  std::vector<std::string> all = {"x", "y", "z"};
  all.insert(all.end(), names.begin(), names.end());
  make_distinct(all);
  for (std::size_t c = 0; c < columns.size(); ++c) columns[c].name = all[3 + c];
}

}  // namespace

const TableColumn* Table::find(std::string_view name) const {
  const auto found = std::ranges::find(columns, name, &TableColumn::name);
  return found == columns.end() ? nullptr : &*found;
}

std::vector<const TableColumn*> Table::find_all(std::span<const std::string_view> names) const {
  std::vector<const TableColumn*> found;
  for (const std::string_view name : names) found.push_back(find(name));
  if (std::ranges::find(found, nullptr) != found.end()) found.clear();
  return found;
}

TableColumn column_of(const Attribute& attribute) {
  const char* const data = reinterpret_cast<const char*>(attribute.data.data());
  return {{attribute.name, native(attribute.type), attribute.components}, {data, data + attribute.data.size()}};
}

TableColumn zero_column(Column column, std::size_t rows) {
  TableColumn result{std::move(column), {}};
  result.data.resize(rows * column_bytes(result));
  return result;
}

std::vector<Position> written_positions(const Cloud& cloud) {
  std::vector<Position> result(cloud.points.size());
  positions(cloud, result);
  if (cloud.source) cloud.source->restore_empty_pixels(result);
  return result;
}

Table make_table(const Cloud& cloud) {
  Table table;
  table.coordinate_type = position_type(cloud);
  table.positions = written_positions(cloud);
  if (cloud.source) {
    for (const Column& its : cloud.source->columns()) table.columns.push_back(zero_column(its, table.size()));
    std::vector<std::span<char>> places;
    for (TableColumn& column : table.columns) places.emplace_back(column.data);
    cloud.source->extract_several(places);
    table.faces = cloud.source->faces();
  }
  for (const Attribute& attribute : cloud.added) {
    TableColumn column = column_of(attribute);
    const auto own = std::ranges::find(table.columns, attribute.name, &TableColumn::name);
    if (own == table.columns.end()) {
      table.columns.push_back(std::move(column));
    } else {
      *own = std::move(column);
    }
  }
  for (TableColumn& column : table.columns)
    if (column.name.empty()) column.name = "unnamed";  // NumPy, among others, takes what has no name for padding
  return table;
}

void use_ply_names(Table& table, ColorDepth depth) {
  // beside channels it is one more attribute
  const bool has_channels = has_all_channels(table.columns);
  std::vector<TableColumn> columns;
  for (TableColumn& column : table.columns) {
    const bool is_packed = column.name == "rgb" || column.name == "rgba";
    if (is_packed && !has_channels && column_bytes(column) == 4 && column.components == 1) {
      split_packed_color(column, columns);
    } else if (column.components != 1) {
      split_components(column, columns);
    } else {
      if (is_unit_color(column))
        change_values(column, NativeType::float32, [](std::size_t, double value) { return value; });
      columns.push_back(std::move(column));
    }
  }
  rename_columns(columns);
  table.columns = std::move(columns);
  use_color_depth(table, depth);
}

void use_words_as_names(Table& table) {
  std::vector<std::string> names = word_names(names_of(table)).names;
  for (std::size_t c = 0; c < names.size(); ++c) table.columns[c].name = std::move(names[c]);
}

std::vector<std::string> ply_names(const Cloud& cloud) {
  Table without_rows;
  for (const AttributeInfo& info : attributes(cloud))
    without_rows.columns.push_back({{info.name, native(info.type), info.components}, {}});
  use_ply_names(without_rows);
  return names_of(without_rows);
}

std::vector<std::string> names_of(const Table& table) {
  std::vector<std::string> names;
  for (const TableColumn& column : table.columns) names.push_back(column.name);
  return names;
}

void append_position(std::string& to, const Table& table, std::size_t row, char separator) {
  for (const double value : table.positions[row]) {
    append_as(to, value, native(table.coordinate_type));
    to += separator;
  }
}

void append_value(std::string& to, const TableColumn& column, std::size_t row, char separator) {
  append_scalar(to, column.data.data() + row * column_bytes(column), column.type);
  to += separator;
}

void write_rows(Output& out, std::size_t rows, const std::function<void(std::size_t, std::string&)>& append_row) {
  write_blocks(out, (rows + kRowsPerBlock - 1) / kRowsPerBlock, [&](std::size_t block, std::string& buffer) {
    const std::size_t end = std::min((block + 1) * kRowsPerBlock, rows);
    for (std::size_t i = block * kRowsPerBlock; i < end; ++i) append_row(i, buffer);
  });
}

}  // namespace pointfair::io
