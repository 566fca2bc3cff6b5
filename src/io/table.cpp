// SPDX-License-Identifier: Apache-2.0
#include "io/table.hpp"

#include <algorithm>
#include <cstring>

#include "io/column_names.hpp"
#include "io/parallel.hpp"

namespace pointfair::io {
namespace {

constexpr std::size_t kRowsPerBlock = 8192;

void take_positions(const Cloud& cloud, Table& table) {
  table.positions.resize(cloud.points.size());
  table.coordinate_type = position_type(cloud);
  positions(cloud, table.positions);
}

// Splits a column into one for each component.
void split_components(const TableColumn& column, std::vector<TableColumn>& to) {
  const std::size_t size = size_of(column.type), stride = column_bytes(column), rows = column.data.size() / stride;
  const auto names = component_names(column.name, column.components);
  for (std::size_t c = 0; c < names.size(); ++c) {
    TableColumn part;
    static_cast<Column&>(part) = {names[c], column.type, 1};
    part.data.resize(rows * size);
    for (std::size_t i = 0; i < rows; ++i) {
      std::memcpy(part.data.data() + i * size, column.data.data() + i * stride + c * size, size);
    }
    to.push_back(std::move(part));
  }
}

// PCD packs colours into the four bytes of one number, 0xAARRGGBB.
void split_packed_color(const TableColumn& column, std::vector<TableColumn>& to) {
  static constexpr const char* kNames[] = {"red", "green", "blue", "alpha"};
  static constexpr int kShifts[] = {16, 8, 0, 24};
  const std::size_t rows = column.data.size() / 4;
  for (std::size_t c = 0; c < (column.name == "rgba" ? 4U : 3U); ++c) {
    TableColumn part;
    static_cast<Column&>(part) = {kNames[c], NativeType::uint8, 1};
    part.data.resize(rows);
    for (std::size_t i = 0; i < rows; ++i) {
      part.data[i] = static_cast<char>(load<std::uint32_t>(column.data.data() + 4 * i, false) >> kShifts[c] & 255);
    }
    to.push_back(std::move(part));
  }
}

// A colour of 16 bits, as LAS has them: some write bytes there all the same.
bool is_wide(const TableColumn& column) {
  if (column.type != NativeType::uint16) return false;
  for (std::size_t at = 0; at < column.data.size(); at += 2) {
    if (load<std::uint16_t>(column.data.data() + at, false) > 255) return true;
  }
  return false;
}

// Colours from 0 to 1, as OBJ has them, become bytes.
void use_byte_colors(Table& table) {
  std::vector<std::array<std::uint8_t, 3>> colors;
  const TableColumn* const red = table.find("red");
  if (!red || is_integer(red->type) || !colors_as_bytes(table, colors)) return;
  for (std::size_t c = 0; c < 3; ++c) {
    static constexpr const char* kNames[] = {"red", "green", "blue"};
    auto& column = *std::find_if(table.columns.begin(), table.columns.end(),
                                 [&](const TableColumn& candidate) { return candidate.name == kNames[c]; });
    column.type = NativeType::uint8;
    column.data.resize(colors.size());
    for (std::size_t i = 0; i < colors.size(); ++i) column.data[i] = static_cast<char>(colors[i][c]);
  }
}

}  // namespace

const TableColumn* Table::find(std::string_view name) const {
  const auto found = std::find_if(columns.begin(), columns.end(), [&](const TableColumn& c) { return c.name == name; });
  return found == columns.end() ? nullptr : &*found;
}

Table make_table(const Cloud& cloud) {
  Table table;
  take_positions(cloud, table);
  if (cloud.source) {
    const std::vector<Column> columns = cloud.source->columns();
    for (std::size_t c = 0; c < columns.size(); ++c) {
      TableColumn column;
      static_cast<Column&>(column) = columns[c];
      column.data.resize(table.size() * column_bytes(column));
      cloud.source->extract(c, column.data);
      table.columns.push_back(std::move(column));
    }
    table.faces = cloud.source->faces();
  }
  for (const Attribute& attribute : cloud.added) {
    TableColumn column;
    static_cast<Column&>(column) = {attribute.name, native(attribute.type), attribute.components};
    const char* data = reinterpret_cast<const char*>(attribute.data.data());
    column.data.assign(data, data + attribute.data.size());
    const auto own = std::find_if(table.columns.begin(), table.columns.end(),
                                  [&](const TableColumn& other) { return other.name == attribute.name; });
    if (own == table.columns.end()) {
      table.columns.push_back(std::move(column));
    } else {
      *own = std::move(column);
    }
  }
  return table;
}

void use_ply_names(Table& table) {
  std::vector<TableColumn> columns;
  for (TableColumn& column : table.columns) {
    if ((column.name == "rgb" || column.name == "rgba") && column_bytes(column) == 4 && column.components == 1) {
      split_packed_color(column, columns);
    } else if (column.components != 1) {
      split_components(column, columns);
    } else {
      column.name = ply_name(column.name);
      columns.push_back(std::move(column));
    }
  }
  table.columns = std::move(columns);
  use_byte_colors(table);
}

bool colors_as_bytes(const Table& table, std::vector<std::array<std::uint8_t, 3>>& colors) {
  const TableColumn* const channels[] = {table.find("red"), table.find("green"), table.find("blue")};
  if (!std::all_of(std::begin(channels), std::end(channels), [](const TableColumn* c) { return c; })) return false;
  colors.resize(table.size());
  const bool wide =
      std::any_of(std::begin(channels), std::end(channels), [](const TableColumn* c) { return is_wide(*c); });
  for (std::size_t c = 0; c < 3; ++c) {
    const NativeType type = channels[c]->type;
    const double scale = !is_integer(type) ? 255 : wide ? 255.0 / 65535 : 1;
    for (std::size_t i = 0; i < colors.size(); ++i) {
      const double value = load_double(channels[c]->data.data() + i * size_of(type), type, false);
      colors[i][c] = narrow<std::uint8_t>(scale * value);
    }
  }
  return true;
}

void write_rows(Output& out, std::size_t rows, const std::function<void(std::size_t, std::string&)>& append_row) {
  write_blocks(out, (rows + kRowsPerBlock - 1) / kRowsPerBlock, [&](std::size_t block, std::string& buffer) {
    const std::size_t end = std::min((block + 1) * kRowsPerBlock, rows);
    for (std::size_t i = block * kRowsPerBlock; i < end; ++i) append_row(i, buffer);
  });
}

}  // namespace pointfair::io
