// SPDX-License-Identifier: Apache-2.0
// Which parts of a text are rows of data, and where they are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "io/text.hpp"

namespace pointfair::io {

/// What is a row of data; all else passes through.
enum class RowRule : std::uint8_t {
  filled,       ///< every line that is not blank
  uncommented,  ///< and does not begin with '#', '%' or "//"
  counted,      ///< and has more than one word: a line with one says how many rows follow
  vertices,     ///< lines whose first word is "v"; a line that ends in '\' goes on in the next
  corners,      ///< lines whose first word is "vertex", in letters of any size
  words,        ///< so many words, whatever lines they stand on
};

struct RowShape {
  RowRule rule = RowRule::filled;
  char line_end = '\n';
  std::size_t words = 0;  ///< of a row, for RowRule::words
};

/// The rows of a text, found in parallel. A chunk ends at the end of a line.
struct TextRows {
  struct Chunk {
    std::size_t begin = 0;        ///< in the text
    std::uint64_t first_row = 0;  ///< rows before it
    std::uint64_t head = 0;       ///< lines at its front that are none, though they look so
  };
  std::vector<Chunk> chunks;  ///< and a last one for the end of the text
  std::uint64_t count() const { return chunks.back().first_row; }
};

/// Whether there are words behind the first one, which may end at `at`.
bool has_further_words(const char* at, const char* end);

/// Whether a line that is a row otherwise has several words.
inline bool has_several_words(std::string_view line) {
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at != end && *at > ',' && *at != ';') ++at;  // as the digits of most words
  return has_further_words(at, end);
}

/// Whether a line begins with this word of small letters, in letters of any size, behind no blanks.
inline bool begins_with_word(std::string_view line, std::string_view word) {
  if (line.size() < word.size()) return false;
  for (std::size_t i = 0; i < word.size(); ++i)
    if ((line[i] | 0x20) != word[i]) return false;
  return line.size() == word.size() || is_blank(line[word.size()]);
}

inline bool is_row(std::string_view line, RowRule rule) {
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at != end && is_blank(*at)) ++at;
  if (at == end) return false;
  if (rule == RowRule::vertices) return *at == 'v' && at + 1 != end && is_blank(at[1]);
  if (rule == RowRule::filled || rule == RowRule::words) return true;
  if (rule == RowRule::corners) return begins_with_word({at, static_cast<std::size_t>(end - at)}, "vertex");
  if (*at == '#') return std::string_view(at, static_cast<std::size_t>(end - at)).starts_with("#N/A");  // of Excel
  if (*at == '%' || (*at == '/' && at + 1 != end && at[1] == '/')) return false;
  return rule != RowRule::counted || has_several_words({at, static_cast<std::size_t>(end - at)});
}

/// Whether the line ends as one that goes on in the next.
inline bool ends_in_backslash(std::string_view line) { return line.ends_with('\\') || line.ends_with("\\\r"); }

/// next_row() where a row is so many words.
bool next_row_of_words(std::string_view& text, std::string_view& line, const RowShape& shape);
/// Adds the lines in which a row goes on that ends in a backslash.
void take_further_lines(std::string_view& text, std::string_view& line, const RowShape& shape);
/// Takes the next line off the front of `text`, or all that may be one row. False: the text is empty.
inline bool next_row(std::string_view& text, std::string_view& line, const RowShape& shape) {
  if (shape.rule == RowRule::words) return next_row_of_words(text, line, shape);
  if (!next_line(text, line, shape.line_end)) return false;
  if (shape.rule == RowRule::vertices && ends_in_backslash(line)) take_further_lines(text, line, shape);
  return true;
}
TextRows find_rows(std::string_view text, const RowShape& shape);
/// Where in the text the line of `row` begins; the text's end if there is no such row.
std::size_t begin_of_row(std::string_view text, const TextRows& rows, const RowShape& shape, std::uint64_t row);

}  // namespace pointfair::io
