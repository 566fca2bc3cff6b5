// SPDX-License-Identifier: Apache-2.0
// Writing lines of text back: words that changed take the place of others, and all else stays.
#include <algorithm>
#include <utility>

#include "io/row_words.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

// What goes between a row and values added to it: its own separator, a tab where it has tabs.
char added_separator(std::string_view line, char separator) {
  return separator == ' ' && line.find('\t') != std::string_view::npos ? '\t' : separator;
}

// Where values that are added to a row go: behind its last word, or, where tabs separate the words, behind the empty
// ones that follow it in the columns of the file.
std::size_t end_of_words(std::string_view line, const TextLayout& layout) {
  std::size_t end = line.size();
  while (end > 0 && is_blank(line[end - 1])) --end;
  if (layout.separator != '\t') return end;
  auto tabs = static_cast<std::size_t>(std::count(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(end), '\t'));
  for (; end < line.size() && line[end] == '\t' && tabs + 1 < layout.columns.size(); ++end) ++tabs;
  return end;
}

// Whether a value read from a word as `type` is this one, so that the word may stay as it is.
bool is_same(std::optional<double> own, double value, ScalarType type) {
  if (!own) return false;
  return *own == value || (type == ScalarType::float32 && static_cast<float>(*own) == static_cast<float>(value));
}

std::string with_comma(std::string number) {
  std::ranges::replace(number, '.', ',');
  return number;
}

// Each value with `separator` before it.
void append_added_words(const AddedAttributes& added, std::uint64_t point, char separator, char decimal,
                        std::string& to) {
  const auto begin = static_cast<std::ptrdiff_t>(to.size());
  for_each_value(added, point,
                 [&](const char* value, NativeType type) { append_scalar(to += separator, value, type); });
  if (decimal == ',') std::replace(to.begin() + begin, to.end(), '.', ',');
}

}  // namespace

const Replacement* TextSource::find_replacement(const std::vector<Replacement>& replaced, std::size_t column) const {
  const auto found = std::ranges::find_if(
      replaced, [&](const Replacement& other) { return attributes_[other.column].first == column; });
  return found == replaced.end() ? nullptr : &*found;
}

// A word of a line, and what takes its place.
struct TextSource::WordEdit {
  std::string_view word;
  std::string text;
};

// Of a block.
struct TextSource::BlockEdits {
  std::size_t block;
  const Moves& moves;
  const Edits& edits;
  std::vector<TextColumn> attributes;
};

void TextSource::append_coordinate(std::string& to, std::string_view word, double value, float offset,
                                   bool exact) const {
  if (layout_.integers) return append_as(to, value, NativeType::int64);
  if (exact) return append_as(to, value, NativeType::float64);
  const bool has_point = layout_.decimal != ',' || word.find('.') != std::string_view::npos;
  if (has_point) return append_moved(to, word, value, offset);
  std::string plain(word), text;
  std::ranges::replace(plain, ',', '.');
  append_moved(text, plain, value, offset);
  to += with_comma(std::move(text));
}

void TextSource::edit_row(std::string_view line, std::size_t place, const BlockEdits& its,
                          std::vector<WordEdit>& edited) const {
  const auto& [block, moves, edits, attributes] = its;
  edited.clear();
  if (moves.changed[place] != 0) {
    const auto words = coordinate_words(line);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if ((moves.changed[place] >> axis & 1) == 0) continue;
      edited.push_back({words[axis], {}});
      // what was given keeps its digits
      append_coordinate(edited.back().text, words[axis], moves.values[place][axis],
                        offset_of(block, moves.values[place], axis), edits.placed != nullptr);
    }
  }
  std::vector<std::string_view> words;
  for (const Replacement& replacement : edits.replaced) {
    const TextColumn& column = attributes[replacement.column];
    column_words(line, layout_, column, words);
    for (std::uint32_t c = 0; c < column.components; ++c) {
      const double value = replacement.value(block_begin(block) + place, c);
      if (words[c].data() == nullptr || is_same(number(words[c]), value, replacement.values->type)) continue;
      edited.push_back({words[c], {}});
      append_as(edited.back().text, value, column.guessed ? native(replacement.values->type) : column.type);
      if (layout_.decimal == ',') edited.back().text = with_comma(std::move(edited.back().text));
    }
  }
  // as they stand in the line
  std::ranges::sort(edited, [](const WordEdit& a, const WordEdit& b) { return a.word.data() < b.word.data(); });
}

void TextSource::append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const {
  const std::string_view text = block_text(block);
  to.reserve(text.size() + text.size() / 4);
  PatchedText patched(text, to);
  std::vector<WordEdit> edited;
  const BlockEdits its{block, moves, edits, attributes_of(block)};
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t place) {
    if (place < 0) return;
    edit_row(line, static_cast<std::size_t>(place), its, edited);
    for (const WordEdit& edit : edited) patched.replace(edit.word, edit.text);
    if (layout_.extendable && !edits.added.empty()) {
      patched.copy_up_to(line.data() + end_of_words(line, layout_));
      append_added_words(edits.added, block_begin(block) + static_cast<std::uint64_t>(place),
                         added_separator(line, layout_.separator), layout_.decimal, to);
    }
  });
  patched.finish();
}

// Lines that are no rows stay.
void TextSource::take_out(std::span<const std::uint8_t> removed, const Edits&, std::string& lines) const {
  const std::string all = std::exchange(lines, {});
  std::string_view rest = all, line;
  std::size_t row = 0;
  for (const char* begin = rest.data(); next_row(rest, line, layout_.shape); begin = rest.data())
    if (!is_row(line, layout_.shape.rule) || removed[row++] == 0) lines.append(begin, rest.data());
}

}  // namespace pointfair::io
