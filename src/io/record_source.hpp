// SPDX-License-Identifier: Apache-2.0
// Points in binary: records of fixed or varying size, or one array after the other.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/scalar.hpp"
#include "io/source.hpp"

namespace pointfair::io {

struct RecordField : Column {
  std::size_t offset = 0;                  ///< of the first point's value in the points' bytes
  std::size_t stride = 0;                  ///< from one point's value to the next point's
  std::optional<NativeType> list_count{};  ///< a list: the type of its count, which comes first
  bool padding = false;
};

/// What of the file is points. `starts` is empty for records of fixed size; else it holds the place of each record in
/// `points`, and past the last, and `offset` and `stride` of the fields are not used.
struct RecordLayout {
  std::size_t begin = 0;  ///< of the points in the file
  std::uint64_t count = 0;
  std::vector<RecordField> fields{};
  std::array<std::size_t, 3> xyz{};  ///< which fields are the coordinates
  std::vector<std::uint64_t> starts{};
  std::size_t record_size = 0;
  bool swap = false;
};

class RecordSource : public Source {
 public:
  /// `points`: the bytes that `layout` describes, part of `bytes` or owned by the derived class.
  RecordSource(FileBytes bytes, std::string name, Format format, Encoding encoding, RecordLayout layout,
               std::string_view points);

  std::size_t block_count() const override;
  std::uint64_t block_begin(std::size_t block) const override;
  void positions(std::size_t block, std::span<Position> out) const override;
  bool copy_points(std::size_t block, std::span<Point> out) const override;
  ScalarType coordinate_type() const override;
  std::vector<Column> columns() const override;
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  /// The step of coordinates that are integers.
  FileInfo info() const override;

 protected:
  std::string header(const Edits&) const override { return std::string(bytes().substr(0, layout_.begin)); }
  std::string_view tail() const override { return bytes().substr(layout_.begin + points_.size()); }
  void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override;
  void take_out(std::span<const std::uint8_t> removed, const Edits& edits, std::string& records) const override;
  /// Writes the moved coordinates and the replaced attributes of a block over a copy of the points' bytes from `base`
  /// on, to which `extra_per_point` bytes were added behind each record.
  void patch(std::size_t block, const Moves& moves, const std::vector<Replacement>& replaced, char* to,
             std::size_t base, std::size_t extra_per_point) const;
  /// The replacement of a field, if it has one.
  const Replacement* find_replacement(const std::vector<Replacement>& replaced, std::size_t field) const;
  const RecordLayout& layout() const { return layout_; }
  std::string_view points() const { return points_; }
  std::size_t record_begin(std::uint64_t point) const;  ///< in `points`

 private:
  std::size_t locate(std::uint64_t point, std::size_t field) const;

  RecordLayout layout_;
  std::string_view points_;
  std::vector<std::size_t> shown_;  // fields that are attributes
};

/// Appends the values of `added` at `point` as a binary file holds them.
void append_added(const AddedAttributes& added, std::uint64_t point, bool swap, std::string& to);

/// Takes records of `size` bytes out of `data`, which holds one for each of `removed` from `begin` on, and ends there.
void take_out_records(std::span<const std::uint8_t> removed, std::size_t size, std::size_t begin, std::string& data);

}  // namespace pointfair::io
