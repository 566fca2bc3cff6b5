// SPDX-License-Identifier: Apache-2.0
// The words of a row of text, whatever it may have: quotes, empty words, lists, further lines.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "io/text_source.hpp"

namespace pointfair::io {

/// The words of one row, column after column; lists are stepped over, and shift the words behind
/// them.
class RowWords {
 public:
  RowWords(std::string_view line, const TextLayout& layout) : line_(line), rest_(line), layout_(layout) {}

  /// The next column, `word` empty for a list. False: the row has no more words, or fewer than a list promises.
  bool next(ColumnKind& kind, std::string_view& word) {
    kind = at_ < layout_.columns.size() ? layout_.columns[at_] : ColumnKind::other;
    ++at_;
    if (!take(word)) return false;
    if (kind != ColumnKind::list) return true;
    const std::optional<std::uint64_t> count = to_count(word);
    if (!count) return false;
    for (std::uint64_t i = 0; i < *count; ++i)
      if (!next_word(rest_, word)) return false;
    word = {};
    return true;
  }

 private:
  bool take(std::string_view& word) {
    if (!next_word(rest_, word, layout_.separator)) return take_last(word);
    return layout_.shape.rule != RowRule::vertices || !word.ends_with('\\') || take_continued(word);
  }

  // The empty word behind a last separator, before the blanks that end the line.
  bool take_last(std::string_view& word) {
    if (ended_ || !ends_with_separator(line_, layout_.separator)) return false;
    ended_ = true;
    std::string_view filled = line_;
    while (is_blank(filled.back()) && filled.back() != layout_.separator) filled.remove_suffix(1);
    word = {filled.data() + filled.size(), 0};
    return true;
  }

  // The row goes on in the next line.
  bool take_continued(std::string_view& word) {
    do word.remove_suffix(1);
    while (word.ends_with('\\'));
    return !word.empty() || next_word(rest_, word, layout_.separator);
  }

  std::string_view line_, rest_;
  const TextLayout& layout_;
  std::size_t at_ = 0;
  bool ended_ = false;
};

/// The words of an attribute in one row; empty where the row is too short.
void column_words(std::string_view line, const TextLayout& layout, const TextColumn& column,
                  std::vector<std::string_view>& words);
/// As many words of a row from column `first` on as `words` has; empty where the row is too short.
void words_from(std::string_view line, const TextLayout& layout, std::size_t first,
                std::vector<std::string_view>& words);

}  // namespace pointfair::io
