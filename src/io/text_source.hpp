// SPDX-License-Identifier: Apache-2.0
// Points in lines of text. Every line that is no point is kept as it is.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "io/scalar.hpp"
#include "io/source.hpp"
#include "io/text.hpp"

namespace pointfair::io {

/// Which lines are rows of data; the others pass through.
enum class RowRule : std::uint8_t {
  filled,       ///< every line that is not blank
  uncommented,  ///< and does not begin with '#' or "//"
  vertices,     ///< lines whose first word is "v"
};

/// The rows of a text, found in parallel. A chunk ends at the end of a line.
struct TextRows {
  struct Chunk {
    std::size_t begin = 0;        ///< in the text
    std::uint64_t first_row = 0;  ///< rows before it
  };
  std::vector<Chunk> chunks;  ///< and a last one for the end of the text
  std::uint64_t count() const { return chunks.back().first_row; }
};

bool is_row(std::string_view line, RowRule rule);
TextRows find_rows(std::string_view text, RowRule rule);
/// Where in the text the line of `row` begins; the text's end if there is no such row.
std::size_t begin_of_row(std::string_view text, const TextRows& rows, RowRule rule, std::uint64_t row);

/// One column of a row, or a list: a count and so many values.
enum class ColumnKind : std::uint8_t { x, y, z, other, list };

struct Narrowest;  // the type that holds the words of a column

/// An attribute, in the columns from `first` on. `typed`: false while the type is unknown.
struct TextColumn : Column {
  std::size_t first = 0;
  bool typed = true;
};

struct TextLayout {
  std::size_t begin = 0;  ///< of the text with the rows in the file; it goes on to the end of the file
  std::size_t end = std::string_view::npos;
  RowRule rule = RowRule::filled;
  char separator = ' ';  ///< of the words in a row, as `next_word` takes it
  TextRows rows;
  std::uint64_t first_row = 0;  ///< the row of the first point
  std::uint64_t count = 0;      ///< points
  std::vector<ColumnKind> columns;
  bool exact = false;                  ///< a row must have exactly these columns; else at least the coordinates
  bool integers = false;               ///< a coordinate is declared as an integer
  bool doubles = false;                ///< a coordinate is declared as a double
  std::vector<TextColumn> attributes;  ///< in their order
  bool extendable = true;              ///< columns may be appended
};

class TextSource : public Source {
 public:
  TextSource(FileBytes bytes, std::string name, Format format, TextLayout layout);

  std::size_t block_count() const override { return layout_.rows.chunks.size() - 1; }
  std::uint64_t block_begin(std::size_t block) const override;
  void positions(std::size_t block, std::span<Position> out) const override;
  ScalarType coordinate_type() const override;
  std::vector<Column> columns() const override;
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;

 protected:
  void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override;
  std::string_view tail() const override { return bytes().substr(layout_.end); }
  const TextLayout& layout() const { return layout_; }
  std::size_t row_begin(std::uint64_t row) const;  ///< in the file
  /// The replacement of the attribute whose first column this is, if it has one.
  const Replacement* find_replacement(const std::vector<Replacement>& replaced, std::size_t column) const;

 private:
  std::string_view chunk_text(std::size_t block) const;
  template <class Visit>
  void for_each_line(std::size_t block, const Visit& visit) const;
  std::array<std::string_view, 3> coordinate_words(std::string_view line) const;
  [[noreturn]] void fail_at(const char* place, const std::string& message) const;
  void check_size() const;
  std::vector<Narrowest> see_columns(std::size_t block) const;
  void find_types() const;
  struct WordEdit;
  void edit_row(std::string_view line, std::uint64_t point, const Moves& moves, std::size_t place, const Edits& edits,
                std::vector<WordEdit>& words) const;

  TextLayout layout_;
  mutable std::once_flag types_found_;
  mutable std::vector<TextColumn> attributes_;
};

/// Appends the values of `added` at `point` as words, each with `separator` before it.
void append_added_words(const AddedAttributes& added, std::uint64_t point, char separator, std::string& to);

}  // namespace pointfair::io
