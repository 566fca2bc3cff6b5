// SPDX-License-Identifier: Apache-2.0
#include "io/text_source.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "io/coordinate_names.hpp"
#include "io/narrowest.hpp"
#include "io/parallel.hpp"

namespace pointfair::io {

namespace {

// The words of one row, column after column; lists are stepped over, and shift the words behind them.
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
    for (std::uint64_t i = 0; i < *count; ++i) {
      if (!next_word(rest_, word)) return false;
    }
    word = {};
    return true;
  }

 private:
  bool take(std::string_view& word) {
    if (!next_word(rest_, word, layout_.separator)) return take_last(word);
    return layout_.shape.rule != RowRule::vertices || !word.ends_with('\\') || take_continued(word);
  }

  // The empty word behind a last separator.
  bool take_last(std::string_view& word) {
    if (ended_ || !ends_with_separator(line_, layout_.separator)) return false;
    ended_ = true;
    word = {rest_.data(), 0};
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

// The words of an attribute in one row; empty where the row is too short.
void column_words(std::string_view line, const TextLayout& layout, const TextColumn& column,
                  std::vector<std::string_view>& words) {
  words.assign(column.components, {});
  RowWords row(line, layout);
  ColumnKind kind{};
  std::string_view word;
  for (std::size_t c = 0; c < column.first + words.size() && row.next(kind, word); ++c) {
    if (c >= column.first) words[c - column.first] = word;
  }
}

// What goes between a row and values added to it: its own separator, a tab where it has tabs.
char added_separator(std::string_view line, char separator) {
  return separator == ' ' && line.find('\t') != std::string_view::npos ? '\t' : separator;
}

// Whether a value read from a word as `type` is this one, so that the word may stay as it is.
bool is_same(std::optional<double> own, double value, ScalarType type) {
  if (!own) return false;
  return *own == value || (type == ScalarType::float32 && static_cast<float>(*own) == static_cast<float>(value));
}

std::string with_comma(std::string number) {
  std::replace(number.begin(), number.end(), '.', ',');
  return number;
}

}  // namespace

void append_added_words(const AddedAttributes& added, std::uint64_t point, char separator, char decimal,
                        std::string& to) {
  const std::size_t begin = to.size();
  for (const Attribute* attribute : added) {
    const std::size_t size = pointfair::size_of(attribute->type);
    const char* from = reinterpret_cast<const char*>(attribute->data.data()) + point * attribute->components * size;
    for (std::uint32_t c = 0; c < attribute->components; ++c, from += size) {
      to += separator;
      append_scalar(to, from, native(attribute->type));
    }
  }
  if (decimal == ',') std::replace(to.begin() + static_cast<std::ptrdiff_t>(begin), to.end(), '.', ',');
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
  const auto x = static_cast<std::size_t>(std::find(layout_.columns.begin(), layout_.columns.end(), ColumnKind::x) -
                                          layout_.columns.begin());
  const auto has = [&](std::size_t column, ColumnKind kind) {
    return column < layout_.columns.size() && layout_.columns[column] == kind;
  };
  const bool in_row =
      has(x + 1, ColumnKind::y) && has(x + 2, ColumnKind::z) &&
      std::find(layout_.columns.begin(), layout_.columns.end(), ColumnKind::list) == layout_.columns.end();
  const bool short_enough = !layout_.exact || layout_.columns.size() == x + 3;
  if (layout_.separator == ' ' && in_row && short_enough) plain_lead_ = x;
}

// What is read stays in proportion to the file, whatever its first lines promise.
void TextSource::check_size() const {
  if (layout_.columns.size() > kMaxTextColumns) {
    fail(name(), "has " + std::to_string(layout_.columns.size()) + " columns, but at most " +
                     std::to_string(kMaxTextColumns) + " can be read; leave some out");
  }
  constexpr std::uint64_t kValuesPerByte = 4;  // at least 2 bytes stand for a value
  if (layout_.count > 0 && layout_.attributes.size() > kValuesPerByte * bytes().size() / layout_.count) {
    fail(name(), "most rows are much shorter than the first, which has " + std::to_string(layout_.columns.size()) +
                     " columns; repair the file");
  }
}

std::uint64_t TextSource::block_begin(std::size_t block) const {
  const std::uint64_t row = layout_.rows.chunks[block].first_row;
  return std::clamp(row, layout_.first_row, layout_.first_row + layout_.count) - layout_.first_row;
}

std::string_view TextSource::block_text(std::size_t block) const {
  const auto& chunks = layout_.rows.chunks;
  return bytes().substr(layout_.begin + chunks[block].begin, chunks[block + 1].begin - chunks[block].begin);
}

// Calls visit(line, point) with the place of the point in the block, or -1 for a line that is no point.
template <class Visit>
void TextSource::for_each_line(std::size_t block, const Visit& visit) const {
  std::string_view text = block_text(block), line;
  std::uint64_t row = layout_.rows.chunks[block].first_row;
  std::ptrdiff_t point = 0;
  while (next_row(text, line, layout_.shape)) {
    const bool data = is_row(line, layout_.shape.rule);
    const bool is_point = data && row - layout_.first_row < layout_.count;
    row += data;
    visit(line, is_point ? point++ : -1);
  }
}

std::size_t TextSource::row_begin(std::uint64_t row) const {
  return layout_.begin + begin_of_row(bytes().substr(layout_.begin), layout_.rows, layout_.shape, row);
}

void TextSource::fail_at(const char* place, const std::string& message) const {
  fail(name(), "line " + std::to_string(line_number(bytes(), place)) + ": " + message);
}

// The usual case: words that blanks separate, x, y and z one behind the other. False: look closer.
bool TextSource::take_plain_words(std::string_view line, std::array<std::string_view, 3>& words) const {
  if (plain_lead_ == kNotPlain) return false;
  std::string_view word;
  for (std::size_t c = 0; c < plain_lead_; ++c) next_word(line, word);
  for (std::string_view& coordinate : words)
    if (!next_word(line, coordinate) || coordinate.ends_with('\\')) return false;
  return !layout_.exact || !next_word(line, word);
}

std::array<std::string_view, 3> TextSource::coordinate_words(std::string_view line) const {
  std::array<std::string_view, 3> result;
  if (take_plain_words(line, result)) return result;
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
  if (found < 3 || (layout_.exact && columns < wanted)) {
    fail_at(line.data(), "too few values: " + quoted(line.substr(0, line.find('\r'))) + "; repair or remove the line");
  }
  if (layout_.exact && row.next(kind, word)) {
    fail_at(line.data(), "more values than the header names, from " + quoted(word) + " on; repair the line");
  }
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
  std::replace(plain.begin(), plain.end(), ',', '.');
  return is_comma_number(word) ? to_number(plain) : std::nullopt;
}

void TextSource::positions(std::size_t block, std::span<Position> out) const {
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
    if (point < 0) return;
    const auto words = coordinate_words(line);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double& to = out[static_cast<std::size_t>(point)][axis];
      if (const std::optional<double> usual = to_number(words[axis])) {
        to = *usual;
        continue;
      }
      const std::optional<double> value = number(words[axis]);
      if (!value) fail_at(line.data(), quoted(words[axis]) + " is not a number; repair or remove the line");
      to = *value;
    }
  });
}

ScalarType TextSource::coordinate_type() const {
  if (layout_.doubles || origin() != Position{}) return ScalarType::float64;
  std::vector<Narrowest> seen(block_count());
  for_each_block(seen.size(), [&](std::size_t block) {
    for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
      if (point < 0) return;
      for (const std::string_view word : coordinate_words(line)) seen[block].see(word, layout_.decimal);
    });
  });
  const bool all = std::all_of(seen.begin(), seen.end(), [](const Narrowest& n) { return n.fits_float; });
  return all ? ScalarType::float32 : ScalarType::float64;
}

// What the words of each column have in common, of those whose type is unknown.
std::vector<Narrowest> TextSource::see_columns(std::size_t block) const {
  std::vector<Narrowest> seen(attributes_.size());
  std::vector<std::size_t> owner;  // the attribute in each column, or as many as there are for none
  for (std::size_t a = 0; a < attributes_.size(); ++a) {
    if (attributes_[a].typed && !attributes_[a].optional) continue;
    owner.resize(std::max(owner.size(), attributes_[a].first + 1), attributes_.size());
    owner[attributes_[a].first] = a;
  }
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
    if (point < 0) return;
    RowWords row(line, layout_);
    ColumnKind kind{};
    for (std::size_t c = 0; c < owner.size(); ++c) {
      std::string_view word;
      if (!row.next(kind, word)) word = {};
      if (owner[c] < seen.size()) seen[owner[c]].see(word, layout_.decimal);
    }
  });
  return seen;
}

// Looks through the columns of unknown type; those with a word that is no number are no attributes.
void TextSource::find_types() const {
  const auto is_known = [](const TextColumn& column) { return column.typed && !column.optional; };
  if (std::all_of(attributes_.begin(), attributes_.end(), is_known)) return;
  std::vector<std::vector<Narrowest>> seen(block_count());
  for_each_block(seen.size(), [&](std::size_t block) { seen[block] = see_columns(block); });
  std::vector<TextColumn> kept;
  for (std::size_t a = 0; a < attributes_.size(); ++a) {
    TextColumn& column = attributes_[a];
    if (!is_known(column)) {
      Narrowest all;
      for (const std::vector<Narrowest>& block : seen) all.merge(block[a]);
      if (!all.numbers && !column.typed) text_columns_.push_back(column.name);
      if (!all.filled || (!all.numbers && !column.typed)) continue;
      if (!column.typed) column.type = all.type();
      column.guessed = !column.typed;
    }
    kept.push_back(column);
  }
  attributes_ = std::move(kept);
}

std::vector<Column> TextSource::columns() const {
  std::call_once(types_found_, [this] { find_types(); });
  return {attributes_.begin(), attributes_.end()};
}

// Lines that are neither rows nor blank, where the format knows remarks.
std::vector<Content> TextSource::contents() const {
  TextSource::columns();
  std::vector<Content> result;
  for (const std::string& column : text_columns_)
    result.push_back({ContentKind::text, "the column of words '" + column + "'"});
  if (layout_.shape.rule == RowRule::filled || layout_.shape.rule == RowRule::words) return result;
  std::vector<std::uint64_t> remarks(block_count());
  for_each_block(remarks.size(), [&](std::size_t block) {
    for_each_line(block, [&](std::string_view line, std::ptrdiff_t) {
      remarks[block] += is_row(line, RowRule::filled) && !is_row(line, RowRule::uncommented);
    });
  });
  const std::uint64_t all = std::accumulate(remarks.begin(), remarks.end(), std::uint64_t{0});
  if (all > 0) result.push_back({ContentKind::comments, counted(all, "comment")});
  return result;
}

void TextSource::extract_block(std::size_t index, std::size_t block, std::span<char> out) const {
  const TextColumn& column = attributes_[index];
  const std::size_t size = size_of(column.type);
  std::vector<std::string_view> words;
  char* to = out.data();
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
    if (point < 0) return;
    column_words(line, layout_, column, words);
    for (const std::string_view word : words) {
      const std::optional<double> value = number(word);
      const bool exact = size_of(column.type) == 8 && is_integer(column.type) && to_integer(word, column.type, to);
      if (!exact) store_double(to, column.type, false, value.value_or(0));
      if (!value) {
        fail_at(line.data(), quoted(word) + " in column " + column.name + " is not a number; repair the line");
      }
      to += size;
    }
  });
}

const Replacement* TextSource::find_replacement(const std::vector<Replacement>& replaced, std::size_t column) const {
  const auto found = std::find_if(replaced.begin(), replaced.end(),
                                  [&](const Replacement& other) { return attributes_[other.column].first == column; });
  return found == replaced.end() ? nullptr : &*found;
}

// A word of a line, and what takes its place.
struct TextSource::WordEdit {
  std::string_view word;
  std::string text;
};

void TextSource::append_coordinate(std::string& to, std::string_view word, double value, std::size_t axis,
                                   bool exact) const {
  if (layout_.integers) return append_as(to, value, NativeType::int64);
  if (exact) return append_as(to, value, NativeType::float64);
  if (layout_.decimal != ',') return append_moved(to, word, value, static_cast<float>(value - origin()[axis]));
  std::string plain(word), text;
  std::replace(plain.begin(), plain.end(), ',', '.');
  append_moved(text, plain, value, static_cast<float>(value - origin()[axis]));
  to += with_comma(std::move(text));
}

void TextSource::edit_row(std::string_view line, std::uint64_t point, const Moves& moves, std::size_t place,
                          const Edits& edits, std::vector<WordEdit>& edited) const {
  edited.clear();
  if (moves.changed[place] != 0) {
    const auto words = coordinate_words(line);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if ((moves.changed[place] >> axis & 1) == 0) continue;
      edited.push_back({words[axis], {}});
      // what was given keeps its digits
      append_coordinate(edited.back().text, words[axis], moves.values[place][axis], axis, edits.placed != nullptr);
    }
  }
  std::vector<std::string_view> words;
  for (const Replacement& replacement : edits.replaced) {
    const TextColumn& column = attributes_[replacement.column];
    column_words(line, layout_, column, words);
    for (std::uint32_t c = 0; c < column.components; ++c) {
      const double value = replacement.value(point, c);
      if (words[c].data() == nullptr || is_same(number(words[c]), value, replacement.values->type)) continue;
      edited.push_back({words[c], {}});
      append_as(edited.back().text, value, column.guessed ? native(replacement.values->type) : column.type);
      if (layout_.decimal == ',') edited.back().text = with_comma(std::move(edited.back().text));
    }
  }
  // as they stand in the line
  std::sort(edited.begin(), edited.end(),
            [](const WordEdit& a, const WordEdit& b) { return a.word.data() < b.word.data(); });
}

void TextSource::append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const {
  const std::string_view text = block_text(block);
  to.reserve(text.size() + text.size() / 4);
  const char* copied = text.data();  // everything before it is in `to`
  const auto copy_up_to = [&](const char* end) {
    to.append(copied, end);
    copied = end;
  };
  std::vector<WordEdit> edited;
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t place) {
    if (place < 0) return;
    const std::uint64_t point = block_begin(block) + static_cast<std::uint64_t>(place);
    edit_row(line, point, moves, static_cast<std::size_t>(place), edits, edited);
    for (const WordEdit& edit : edited) {
      copy_up_to(edit.word.data());
      to += edit.text;
      copied = edit.word.data() + edit.word.size();
    }
    if (layout_.extendable && !edits.added.empty()) {
      std::size_t end = line.size();
      while (end > 0 && is_blank(line[end - 1])) --end;
      copy_up_to(line.data() + end);
      append_added_words(edits.added, point, added_separator(line, layout_.separator), layout_.decimal, to);
    }
  });
  copy_up_to(text.data() + text.size());
}

}  // namespace pointfair::io
