// SPDX-License-Identifier: Apache-2.0
// A file whose points were given other positions, in double: all else stays as the file has it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/source.hpp"

namespace pointfair::io {

class PlacedSource final : public Source {
 public:
  /// `file` may be null: then there is nothing but positions. `type`: coordinate_type(), chosen by what holds them
  /// without it.
  PlacedSource(std::shared_ptr<const Source> file, std::vector<Position> positions,
               std::optional<ScalarType> type = {});

  std::size_t block_count() const override;
  std::uint64_t block_begin(std::size_t block) const override;
  void positions(std::size_t block, std::span<Position> out) const override;
  void restore_empty_pixels(std::span<Position> all) const override {
    if (file_) file_->restore_empty_pixels(all);
  }
  ScalarType coordinate_type() const override { return type_; }
  std::vector<Column> columns() const override;
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  void visit_faces(FaceVisitor& visitor) const override {
    if (file_) file_->visit_faces(visitor);
  }
  Materials materials() const override { return file_ ? file_->materials() : Materials{}; }
  FaceSummary face_summary() const override { return file_ ? file_->face_summary() : FaceSummary{}; }
  void write(const Edits& edits, Encoding encoding, Output& out) const override;
  bool holds_its_positions() const override;
  void check_las_scale(double scale) const override { file_->check_las_scale(scale); }
  std::optional<Position> sensor(std::size_t block) const override;
  bool says_sensor() const override { return !file_ || file_->says_sensor(); }
  FileInfo info() const override { return file_ ? file_->info() : FileInfo{}; }
  bool has_geotiff_keys() const override { return file_ && file_->has_geotiff_keys(); }
  std::vector<std::string> losses(Encoding to) const override;
  std::vector<std::string> losses_of_moves(const Edits& edits) const override;
  std::vector<Content> contents() const override { return file_ ? file_->contents() : std::vector<Content>{}; }
  std::vector<std::string> names_by_place() const override {
    return file_ ? file_->names_by_place() : std::vector<std::string>{};
  }
  std::string why_fixed(std::size_t column) const override { return file_ ? file_->why_fixed(column) : std::string(); }
  std::vector<std::string> companions() const override;

  const std::shared_ptr<const Source>& file() const { return file_; }
  /// Of the points from `first` on, which lie at `of_file` in the file.
  Moves moves_of_file(std::uint64_t first, std::vector<Position> of_file, const Edits& edits) const;

 private:
  Edits edits_of_file(Edits edits) const;

  std::shared_ptr<const Source> file_;
  std::vector<Position> positions_;
  ScalarType type_;
};

/// The cloud with these positions around the origin that it has, and all else of its file.
Cloud placed(const Cloud& cloud, std::vector<Position> positions, std::optional<ScalarType> type = {});

}  // namespace pointfair::io
