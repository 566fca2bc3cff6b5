// SPDX-License-Identifier: Apache-2.0
#include "io/text_source.hpp"

#include <algorithm>
#include <limits>

#include "io/coordinate_names.hpp"
#include "io/plain_row.hpp"
#include "io/row_words.hpp"

namespace pointfair::io {

void column_words(std::string_view line, const TextLayout& layout, const TextColumn& column,
                  std::vector<std::string_view>& words) {
  words.resize(column.components);
  words_from(line, layout, column.first, words);
}

void words_from(std::string_view line, const TextLayout& layout, std::size_t first,
                std::vector<std::string_view>& words) {
  std::ranges::fill(words, std::string_view());
  RowWords row(line, layout);
  ColumnKind kind{};
  std::string_view word;
  for (std::size_t c = 0; c < first + words.size() && row.next(kind, word); ++c)
    if (c >= first) words[c - first] = word;
  end_at_remark(layout.shape, words);
}

TextSource::TextSource(FileBytes bytes, std::string name, Format format, TextLayout layout)
    : Source(std::move(bytes), std::move(name), format, Encoding::ascii),
      layout_(std::move(layout)),
      attributes_(layout_.attributes) {
  layout_.end = std::min(layout_.end, this->bytes().size());
  std::vector<std::string> names = {"x", "y", "z"};
  for (const TextColumn& column : attributes_) names.push_back(column.name);
  make_distinct(names);
  for (std::size_t a = 0; a < attributes_.size(); ++a) attributes_[a].name = names[3 + a];
  check_size();
  const auto x = static_cast<std::size_t>(std::ranges::find(layout_.columns, ColumnKind::x) - layout_.columns.begin());
  const auto has = [&](std::size_t column, ColumnKind kind) {
    return column < layout_.columns.size() && layout_.columns[column] == kind;
  };
  const bool in_row = has(x + 1, ColumnKind::y) && has(x + 2, ColumnKind::z);
  plain_ = std::ranges::find(layout_.columns, ColumnKind::list) == layout_.columns.end();
  if (plain_ && in_row) plain_lead_ = x;
  const auto may_be_left_out = [&](const TextColumn& column) { return column.optional && column.first >= x + 3; };
  if (!attributes_.empty() && std::ranges::all_of(attributes_, may_be_left_out))
    ends_with_z_ = std::vector<std::atomic<bool>>(block_count());
  release_all();  // which was read for its rows
}

// What is read stays in proportion to the file, whatever its first lines promise.
void TextSource::check_size() const {
  if (layout_.columns.size() > kMaxTextColumns)
    fail(name(), "has " + std::to_string(layout_.columns.size()) + " columns, but at most " +
                     std::to_string(kMaxTextColumns) + " can be read; leave some out");
  constexpr std::uint64_t kValuesPerByte = 4;  // at least 2 bytes stand for a value
  if (layout_.count > 0 && layout_.attributes.size() > kValuesPerByte * bytes().size() / layout_.count)
    fail(name(), "most rows are much shorter than the first, which has " + std::to_string(layout_.columns.size()) +
                     " columns; repair the file");
}

std::uint64_t TextSource::block_begin(std::size_t block) const {
  const std::uint64_t row = layout_.rows.chunks[block].first_row;
  return std::clamp(row, layout_.first_row, layout_.first_row + layout_.count) - layout_.first_row;
}

std::string_view TextSource::block_text(std::size_t block) const {
  const auto& chunks = layout_.rows.chunks;
  return bytes().substr(layout_.begin + chunks[block].begin, chunks[block + 1].begin - chunks[block].begin);
}

std::size_t TextSource::row_begin(std::uint64_t row) const {
  return layout_.begin + begin_of_row(bytes().substr(layout_.begin), layout_.rows, layout_.shape, row);
}

// Whether a row has as many words as it must, its first ones up to z taken.
bool TextSource::ends_as_declared(PlainRow& row) const {
  return !layout_.exact || (row.skip(layout_.columns.size() - plain_lead_ - 3) && row.is_at_end());
}

std::array<std::string_view, 3> TextSource::coordinate_words(std::string_view line) const {
  std::array<std::string_view, 3> result;
  PlainRow plain(line, layout_.separator);
  if (plain_lead_ != kNotPlain && plain.skip(plain_lead_) && plain.word(result[0]) && plain.word(result[1]) &&
      plain.word(result[2]) && ends_as_declared(plain))
    return result;
  RowWords row(line, layout_);
  ColumnKind kind{};
  std::string_view word;
  std::size_t found = 0, columns = 0;
  const std::size_t wanted = layout_.columns.size();
  while ((layout_.exact ? columns < wanted : found < 3) && row.next(kind, word)) {
    ++columns;
    if (kind > ColumnKind::z) continue;
    result[static_cast<std::size_t>(kind)] = word;
    ++found;
  }
  if (found < 3 || (layout_.exact && columns < wanted))
    fail_at(line.data(), "too few values: " + quoted(line.substr(0, line.find('\r'))) +
                             "; points need x, y and z: " + layout_.advice);
  if (layout_.exact && row.next(kind, word))
    fail_at(line.data(), "more values than the header names, from " + quoted(word) + " on; repair the line");
  return result;
}

std::optional<double> TextSource::number(std::string_view word) const {
  if (layout_.decimal != '.' || word.empty()) return number_with_comma(word);
  return to_number(word);
}

// An empty word between separators is a number that is missing.
std::optional<double> TextSource::number_with_comma(std::string_view word) const {
  if (word.empty()) return std::numeric_limits<double>::quiet_NaN();
  if (word.find(',') == std::string_view::npos) return to_number(word);
  std::string plain(word);
  std::ranges::replace(plain, ',', '.');
  return is_comma_number(word) ? to_number(plain) : std::nullopt;
}

bool TextSource::take_plain_position(std::string_view line, Position& position, bool& ends_with_z) const {
  if (plain_lead_ == kNotPlain) return false;
  PlainRow row(line, layout_.separator);
  if (!row.skip(plain_lead_) || !row.position(position)) return false;
  ends_with_z = ends_with_z && row.is_at_end();
  return ends_as_declared(row);
}

void TextSource::positions(std::size_t block, std::span<Position> out) const {
  bool ends_with_z = true;
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
    if (point < 0 || take_plain_position(line, out[static_cast<std::size_t>(point)], ends_with_z)) return;
    ends_with_z = false;  // not looked at
    const auto words = coordinate_words(line);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::optional<double> value = number(words[axis]);
      if (!value) fail_at(line.data(), quoted(words[axis]) + " is not a number; " + layout_.advice);
      out[static_cast<std::size_t>(point)][axis] = *value;
    }
  });
  if (!ends_with_z_.empty()) ends_with_z_[block] = ends_with_z;
  release(block_text(block));
}

// The numbers of an attribute, with which the rest of a row begins. False: look closer.
bool TextSource::take_plain_numbers(PlainRow& row, const TextColumn& column, char* to) {
  const bool is_wide = size_of(column.type) == 8 && is_integer(column.type);
  for (std::uint32_t c = 0; c < column.components; ++c, to += size_of(column.type)) {
    std::string_view word;
    unsigned count = 0;
    if (row.is_at_end()) {  // the number is missing
      store_double(to, column.type, false, std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    double value = 0;
    if (is_wide && row.word(word) && to_integer(word, column.type, to)) continue;
    if (column.type == NativeType::uint8 && row.short_count(count)) {
      value = count;
    } else if (is_wide || !row.number(value)) {
      return false;
    }
    store_double(to, column.type, false, value);
  }
  return true;
}

// The numbers of an attribute in any row.
void TextSource::take_numbers(std::string_view line, const TextColumn& column, std::vector<std::string_view>& words,
                              char* to) const {
  column_words(line, layout_, column, words);
  for (const std::string_view word : words) {
    const std::optional<double> value = number(word);
    const bool exact = size_of(column.type) == 8 && is_integer(column.type) && to_integer(word, column.type, to);
    if (!exact) store_double(to, column.type, false, value.value_or(0));
    if (!value) fail_at(line.data(), quoted(word) + " in column " + column.name + " is not a number; repair the line");
    to += size_of(column.type);
  }
}

void TextSource::extract_block(std::size_t index, std::size_t block, std::span<char> out) const {
  std::vector<std::span<char>> places(attributes_.size());
  places[index] = out;
  TextSource::extract_several_of_block(block, places);
}

// The attributes stand in a row in their order, so that one walk along it finds them all.
void TextSource::extract_several_of_block(std::size_t block, std::span<const std::span<char>> out) const {
  std::vector<std::string_view> words;
  const std::vector<TextColumn> attributes = attributes_of(block);
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
    if (point < 0) return;
    PlainRow row(line, layout_.separator);
    bool is_plain = plain_;
    std::size_t at = 0;
    for (std::size_t a = 0; a < attributes.size(); ++a) {
      if (out[a].empty()) continue;
      const TextColumn& column = attributes[a];
      char* const to = out[a].data() + static_cast<std::size_t>(point) * column_bytes(column);
      is_plain = is_plain && column.first >= at && row.skip(column.first - at) && take_plain_numbers(row, column, to);
      if (!is_plain) take_numbers(line, column, words, to);
      at = column.first + column.components;
    }
  });
  for (std::size_t c = attributes.size(); c < out.size(); ++c)  // not in the rows
    if (!out[c].empty()) extract_block(c, block, out[c]);
}

}  // namespace pointfair::io
