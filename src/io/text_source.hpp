// SPDX-License-Identifier: Apache-2.0
// Points in lines of text. Every line that is no point is kept as it is.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "io/scalar.hpp"
#include "io/source.hpp"
#include "io/text.hpp"
#include "io/text_rows.hpp"

namespace pointfair::io {

/// One column of a row, or a list: a count and so many values.
enum class ColumnKind : std::uint8_t { x, y, z, other, list };

struct Narrowest;  // the type that holds the words of a column
class PlainRow;    // a usual row, word by word

/// An attribute, in the columns from `first` on. `typed`: false while the type is unknown.
struct TextColumn : Column {
  std::size_t first = 0;
  bool typed = true;
  bool optional = false;     ///< there is no such attribute unless some row has it
  bool has_numbers = false;  ///< a word that is none is an error, also where the type is unknown
  bool is_fraction = false;  ///< floats where they hold the numbers, whatever digits those happen to have
};

struct TextLayout {
  std::size_t begin = 0;  ///< of the text with the rows in the file; it goes on to the end of the file
  std::size_t end = std::string_view::npos;
  RowShape shape;
  char separator = ' ';  ///< of the words in a row, as `next_word` takes it
  char decimal = '.';    ///< or ','
  TextRows rows;
  std::uint64_t first_row = 0;  ///< the row of the first point
  std::uint64_t count = 0;      ///< points
  std::vector<ColumnKind> columns;
  bool exact = false;                  ///< a row must have exactly these columns; else at least the coordinates
  bool integers = false;               ///< a coordinate is declared as an integer
  bool doubles = false;                ///< a coordinate is declared as a double
  std::vector<TextColumn> attributes;  ///< in their order
  bool extendable = true;              ///< columns may be appended
  std::string advice = "repair or remove the line";  ///< where a point is damaged
};

/// Of a vertex of OBJ: leaves the words behind it empty from the remark on that may follow.
inline void end_at_remark(const RowShape& shape, std::vector<std::string_view>& words) {
  bool is_remark = false;
  for (std::size_t w = 0; w < words.size() && shape.rule == RowRule::vertices; ++w) {
    is_remark = is_remark || words[w].starts_with('#');
    if (is_remark) words[w] = {};
  }
}

class TextSource : public Source {
 public:
  TextSource(FileBytes bytes, std::string name, Format format, TextLayout layout);

  std::size_t block_count() const override { return layout_.rows.chunks.size() - 1; }
  std::uint64_t block_begin(std::size_t block) const override;
  void positions(std::size_t block, std::span<Position> out) const override;
  ScalarType coordinate_type() const override;
  std::vector<Column> columns() const override;
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  void extract_several_of_block(std::size_t block, std::span<const std::span<char>> out) const override;
  std::vector<Content> contents() const override;
  /// The step of coordinates that are declared as integers.
  FileInfo info() const override {
    FileInfo result;
    result.step = layout_.integers ? 1 : 0;
    return result;
  }

 protected:
  void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override;
  void take_out(std::span<const std::uint8_t> removed, const Edits& edits, std::string& lines) const override;
  std::string header(const Edits&) const override { return std::string(bytes().substr(0, layout_.begin)); }
  std::string_view tail() const override { return bytes().substr(layout_.end); }
  /// Of columns() those in the rows; and where they stand in the rows of a block. After columns() was called.
  std::size_t attribute_count() const { return attributes_.size(); }
  virtual std::vector<TextColumn> attributes_of(std::size_t) const { return attributes_; }
  /// How far a moved position of a block is from the origin along an axis, which says how many digits it has.
  virtual float offset_of(std::size_t, const Position& position, std::size_t axis) const {
    return static_cast<float>(position[axis] - origin()[axis]);
  }
  const TextLayout& layout() const { return layout_; }
  std::string_view block_text(std::size_t block) const;
  std::size_t row_begin(std::uint64_t row) const;  ///< in the file
  /// The replacement of the attribute whose first column this is, if it has one.
  const Replacement* find_replacement(const std::vector<Replacement>& replaced, std::size_t column) const;

 private:
  /// Calls visit(line, point) with the place of the point in the block, or -1 for a line that is no point.
  template <class Visit>
  void for_each_line(std::size_t block, const Visit& visit) const;
  std::array<std::string_view, 3> coordinate_words(std::string_view line) const;
  // Of usual rows; false for another.
  bool take_plain_position(std::string_view line, Position& position, bool& ends_with_z) const;
  static bool take_plain_numbers(PlainRow& row, const TextColumn& column, char* to);
  void take_numbers(std::string_view line, const TextColumn& column, std::vector<std::string_view>& words,
                    char* to) const;
  bool take_plain_words(std::string_view line, std::size_t first, std::vector<std::string_view>& words) const;
  bool ends_as_declared(PlainRow& row) const;
  void check_size() const;
  std::vector<Narrowest> see_columns(std::size_t block) const;
  void find_types() const;
  std::optional<double> number(std::string_view word) const;
  std::optional<double> number_with_comma(std::string_view word) const;
  void append_coordinate(std::string& to, std::string_view word, double value, float offset, bool exact) const;
  struct WordEdit;
  struct BlockEdits;
  void edit_row(std::string_view line, std::size_t place, const BlockEdits& edits, std::vector<WordEdit>& words) const;

  static constexpr std::size_t kNotPlain = static_cast<std::size_t>(-1);

  TextLayout layout_;
  bool plain_ = false;                  ///< rows have no lists
  std::size_t plain_lead_ = kNotPlain;  ///< columns before x, of plain rows where y and z follow it
  /// Of each block: whether positions() found no word behind the coordinates, where attributes are optional.
  mutable std::vector<std::atomic<bool>> ends_with_z_;
  mutable std::once_flag types_found_;
  mutable std::vector<TextColumn> attributes_;
  mutable std::vector<std::string> text_columns_, rounded_columns_;
};

template <class Visit>
void TextSource::for_each_line(std::size_t block, const Visit& visit) const {
  std::string_view text = block_text(block), line;
  std::uint64_t row = layout_.rows.chunks[block].first_row, head = layout_.rows.chunks[block].head;
  std::ptrdiff_t point = 0;
  while (next_row(text, line, layout_.shape)) {
    bool data = is_row(line, layout_.shape.rule);
    if (data && head > 0) data = false, --head;
    const bool is_point = data && row - layout_.first_row < layout_.count;
    row += data;
    visit(line, is_point ? point++ : -1);
  }
}

}  // namespace pointfair::io
