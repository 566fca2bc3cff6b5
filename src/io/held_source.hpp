// SPDX-License-Identifier: Apache-2.0
// Points that were put together from several parts of a file, and are held in memory. Such a file is read only.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "io/source.hpp"
#include "io/table.hpp"

namespace pointfair::io {

class HeldSource : public Source {
 public:
  HeldSource(std::string name, Format format, Encoding encoding, Table table)
      : Source(FileBytes::copy({}), std::move(name), format, encoding), table_(std::move(table)) {}

  std::size_t block_count() const override { return (table_.size() + kBlock - 1) / kBlock; }
  std::uint64_t block_begin(std::size_t block) const override { return std::min(block * kBlock, table_.size()); }
  void positions(std::size_t block, std::span<Position> out) const override {
    std::copy_n(table_.positions.begin() + std::ptrdiff_t(block_begin(block)), out.size(), out.begin());
  }
  ScalarType coordinate_type() const override { return table_.coordinate_type; }
  std::vector<Column> columns() const override { return {table_.columns.begin(), table_.columns.end()}; }
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override {
    const TableColumn& column = table_.columns[index];
    std::copy_n(column.data.begin() + std::ptrdiff_t(block_begin(block) * column_bytes(column)), out.size(),
                out.begin());
  }
  void visit_faces(FaceVisitor& visitor) const override { visit(table_.faces, visitor); }

 private:
  static constexpr std::size_t kBlock = 4096;

  Table table_;
};

}  // namespace pointfair::io
