// SPDX-License-Identifier: Apache-2.0
// A LAS or LAZ file behind a cloud.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/las/coordinate_system.hpp"
#include "io/las/fields.hpp"
#include "io/las/laz.hpp"
#include "io/las/store.hpp"
#include "io/source.hpp"

namespace pointfair::io::las {

/// What a file has beside its points' records.
struct Layout {
  Header header;
  std::optional<Compression> compression;
  std::size_t chunks_end = 0;  ///< of the last chunk, or of the points
  std::size_t table_begin = 0;
  std::size_t points_end = 0;  ///< where what follows the points and their table begins

  /// An octree goes with the chunks. Its record in an uncompressed file means nothing.
  bool is_copc() const { return compression && header.find("copc", 1); }
};

class LasSource : public Source {
 public:
  LasSource(FileBytes bytes, std::string name, Layout layout, std::unique_ptr<PointStore> store);

  std::size_t block_count() const override { return store_->block_count(); }
  std::uint64_t block_begin(std::size_t block) const override { return store_->block_begin(block); }
  void positions(std::size_t block, std::span<Position> out) const override;
  ScalarType coordinate_type() const override { return ScalarType::float64; }
  std::vector<Column> columns() const override { return {fields_.begin(), fields_.end()}; }
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  void write(const Edits& edits, Encoding encoding, Output& out) const override;
  bool leaves_points_out() const override { return true; }
  void check_las_scale(double scale) const override;
  std::vector<std::string> losses(Encoding) const override;
  std::vector<Content> contents() const override;
  std::vector<std::string> companions() const override;
  FileInfo info() const override;
  bool has_geotiff_keys() const override { return las::has_geotiff_keys(layout_.header); }

 private:
  friend class LasWriter;

  Layout layout_;
  std::unique_ptr<PointStore> store_;
  std::vector<Field> fields_;
};

}  // namespace pointfair::io::las
