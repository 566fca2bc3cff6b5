// SPDX-License-Identifier: Apache-2.0
// A file without some of its points. Written by its own format where that can leave points out, else anew: a copy of
// its bytes cannot have fewer.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/source.hpp"

namespace pointfair::io {

/// What a copy of a file that leaves points out does not keep beside Source::losses(), a sentence each.
std::vector<std::string> losses_by_removal(const Source& file);

class RemainingSource final : public Source {
 public:
  /// Without the points of which `removed` is not 0, and without the faces that have one of them as a corner.
  RemainingSource(std::shared_ptr<const Source> file, std::span<const std::uint8_t> removed);

  std::size_t block_count() const override { return file_->block_count(); }
  std::uint64_t block_begin(std::size_t block) const override;
  void positions(std::size_t block, std::span<Position> out) const override;
  ScalarType coordinate_type() const override { return file_->coordinate_type(); }
  std::vector<Column> columns() const override { return columns_; }
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  void visit_faces(FaceVisitor& visitor) const override;
  Materials materials() const override { return file_->materials(); }
  void write(const Edits& edits, Encoding encoding, Output& out) const override;
  bool holds_its_positions() const override { return file_->leaves_points_out(); }
  void check_las_scale(double scale) const override { file_->check_las_scale(scale); }
  std::optional<Position> sensor(std::size_t block) const override { return file_->sensor(block); }
  bool says_sensor() const override { return file_->says_sensor(); }
  FileInfo info() const override { return of_some_points(file_->info()); }
  bool has_geotiff_keys() const override { return file_->has_geotiff_keys(); }
  std::vector<Content> contents() const override { return file_->contents(); }
  std::vector<std::string> names_by_place() const override { return file_->names_by_place(); }
  std::string why_fixed(std::size_t column) const override { return file_->why_fixed(column); }
  std::vector<std::string> losses(Encoding to) const override;
  std::vector<std::string> companions() const override;

 private:
  std::span<const std::uint32_t> kept_of(std::size_t block) const;
  Attribute of_all(const Attribute& remaining) const;
  std::vector<Position> of_all(const PlacedSource& remaining) const;

  std::shared_ptr<const Source> file_;
  std::vector<Column> columns_;
  std::vector<std::uint32_t> kept_;        // which points of the file
  std::vector<std::uint64_t> block_ends_;  // among them, of each block of the file
};

}  // namespace pointfair::io
