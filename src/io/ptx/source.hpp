// SPDX-License-Identifier: Apache-2.0
// A PTX file behind a cloud: the points of all its scans, one scan after the other, in the coordinates that they share.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "io/ptx/scans.hpp"
#include "io/source.hpp"

namespace pointfair::io::ptx {

class PtxSource final : public Source {
 public:
  PtxSource(FileBytes bytes, std::string name, Layout layout);

  std::size_t block_count() const override { return layout_.blocks.size(); }
  std::uint64_t block_begin(std::size_t block) const override {
    return block < layout_.blocks.size() ? layout_.blocks[block].first_point : layout_.size;
  }
  void positions(std::size_t block, std::span<Position> out) const override;
  ScalarType coordinate_type() const override;
  std::vector<Column> columns() const override;
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  void extract_several_of_block(std::size_t block, std::span<const std::span<char>> out) const override;
  void write(const Edits& edits, Encoding encoding, Output& out) const override;
  std::optional<Position> sensor(std::size_t block) const override;
  FileInfo info() const override;
  std::vector<Content> contents() const override;

 private:
  struct RowEditor;

  const Scan& scan_of(std::size_t block) const { return layout_.scans[layout_.blocks[block].scan]; }
  template <class Visit>
  void for_each_row(std::size_t block, const Visit& visit) const;
  /// The coordinates in the scan's own system; zeros for an invalid point.
  Position own_position(std::string_view row) const;
  void find_types() const;
  /// The number at `index` of a row that is not usual; nothing where the row is too short.
  std::optional<double> number_at(std::string_view row, std::size_t index, const Column& column) const;
  void fill_absent(const Column& column, std::size_t block, std::span<char> out) const;
  void append_edited(std::size_t block, const Edits& edits, std::string& to) const;

  Layout layout_;
  mutable std::once_flag types_found_;
  mutable std::vector<Column> columns_;
};

}  // namespace pointfair::io::ptx
