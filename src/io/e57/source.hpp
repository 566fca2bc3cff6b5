// SPDX-License-Identifier: Apache-2.0
// An E57 file behind a cloud: the points of all its scans, one scan after the other, in the coordinates that they
// share.
#pragma once

#include <string>
#include <vector>

#include "io/e57/document.hpp"
#include "io/e57/streams.hpp"
#include "io/source.hpp"

namespace pointfair::io::e57 {

/// A scan and where its points are.
struct ScanPoints : Scan {
  std::vector<std::vector<Piece>> streams;  ///< of each field
  std::uint64_t first_point = 0;            ///< among those of all scans

  const std::array<std::size_t, 3>& coordinates() const { return cartesian ? *cartesian : *spherical; }
};

/// The value that the bits of a field stand for.
double value_of(const Field& field, std::uint64_t bits);

/// The values of a field in `count` records from `first` on, as numbers.
void read_values(std::string_view file, const ScanPoints& scan, std::size_t field, std::uint64_t first,
                 std::span<double> out);

/// The coordinates of records from `first` on as the scan has them: x, y, z, or range, azimuth and elevation.
void read_coordinates(std::string_view file, const ScanPoints& scan, std::uint64_t first, std::span<Position> out);

/// x, y, z of range, azimuth and elevation, and back; the azimuth within half a turn of `near`.
Position from_spherical(const Position& spherical);
Position to_spherical(const Position& position, double near);

class E57Source : public Source {
 public:
  E57Source(FileBytes bytes, std::string name, FileHeader header, Document document);

  std::size_t block_count() const override { return blocks_.size(); }
  std::uint64_t block_begin(std::size_t block) const override {
    return block < blocks_.size() ? begin_of(block) : size_;
  }
  void positions(std::size_t block, std::span<Position> out) const override;
  ScalarType coordinate_type() const override { return ScalarType::float64; }
  std::vector<Column> columns() const override { return columns_; }
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  void write(const Edits& edits, Encoding encoding, Output& out) const override;
  std::vector<std::string> losses_of_moves(const Edits& edits) const override;
  std::vector<Content> contents() const override;
  std::optional<Position> sensor(std::size_t block) const override;
  FileInfo info() const override;

 private:
  friend class E57Writer;

  struct Block {
    std::size_t scan;
    std::uint64_t first, count;  // of the scan's records
  };
  std::uint64_t begin_of(std::size_t block) const {
    return scans_[blocks_[block].scan].first_point + blocks_[block].first;
  }
  void find_columns();
  std::uint64_t count_directions() const;
  std::string absent_in_some() const;
  /// The coordinates of records of a scan as all scans share them; NaN where the file says that they mean nothing.
  void read_positions(const ScanPoints& scan, std::uint64_t first, std::span<Position> out) const;

  FileHeader header_;
  std::vector<ScanPoints> scans_;
  std::vector<Block> blocks_;
  std::uint64_t size_ = 0;
  std::vector<Column> columns_;
  std::string library_, coordinate_metadata_;
  std::uint64_t images_ = 0;
};

}  // namespace pointfair::io::e57
