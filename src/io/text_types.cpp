// SPDX-License-Identifier: Apache-2.0
// The types of columns of text, and what a text holds beside numbers: by all its words.
#include <algorithm>
#include <numeric>

#include "io/narrowest.hpp"
#include "io/parallel.hpp"
#include "io/plain_row.hpp"
#include "io/row_words.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {

ScalarType TextSource::coordinate_type() const {
  if (layout_.doubles || origin() != Position{}) return ScalarType::float64;
  std::vector<Narrowest> seen(block_count());
  for_each_block(seen.size(), [&](std::size_t block) {
    for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
      if (point < 0) return;
      for (const std::string_view word : coordinate_words(line)) seen[block].see(word, layout_.decimal);
    });
    release(block_text(block));
  });
  const bool all = std::all_of(seen.begin(), seen.end(), [](const Narrowest& n) { return n.fits_float; });
  return all ? ScalarType::float32 : ScalarType::float64;
}

// The words of a row from column `first` on, empty where it ends before. False: look closer.
bool TextSource::take_plain_words(std::string_view line, std::size_t first,
                                  std::vector<std::string_view>& words) const {
  PlainRow row(line, layout_.separator);
  if (!row.skip(first) && !row.is_at_end()) return false;
  for (std::string_view& word : words) {
    if (row.word(word)) continue;
    if (!row.is_at_end()) return false;
    word = {};
  }
  end_at_remark(layout_.shape, words);
  return true;
}

// What the words of each column have in common, of those whose type is unknown.
std::vector<Narrowest> TextSource::see_columns(std::size_t block) const {
  std::vector<Narrowest> seen(attributes_.size());
  if (!ends_with_z_.empty() && ends_with_z_[block]) return seen;
  std::vector<std::size_t> owner;  // the attribute in each column, or as many as there are for none
  const std::vector<TextColumn> attributes = attributes_of(block);
  for (std::size_t a = 0; a < attributes.size(); ++a) {
    if (attributes[a].typed && !attributes[a].optional) continue;
    owner.resize(std::max(owner.size(), attributes[a].first + 1), attributes.size());
    owner[attributes[a].first] = a;
  }
  const auto first = static_cast<std::size_t>(
      std::find_if(owner.begin(), owner.end(), [&](std::size_t a) { return a < seen.size(); }) - owner.begin());
  std::vector<std::string_view> words(owner.size() - first);
  for_each_line(block, [&](std::string_view line, std::ptrdiff_t point) {
    if (point < 0) return;
    if (!plain_ || !take_plain_words(line, first, words)) words_from(line, layout_, first, words);
    for (std::size_t c = first; c < owner.size(); ++c)
      if (owner[c] < seen.size()) seen[owner[c]].see(words[c - first], layout_.decimal);
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
      const bool has_words = !all.numbers && !column.typed && !column.has_numbers;
      if (has_words) text_columns_.push_back(column.name);
      if (!all.filled || has_words) continue;
      if (column.is_fraction && all.fits_float) all.integers = false;
      if (!column.typed) column.type = all.type();
      column.guessed = !column.typed;
      if (column.guessed && all.has_wide && !is_integer(column.type)) rounded_columns_.push_back(column.name);
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
  for (const std::string& column : rounded_columns_)
    result.push_back({ContentKind::text, "the last digits of the column '" + column + "', in which some are missing"});
  constexpr RowRule kWithoutRemarks[] = {RowRule::filled, RowRule::corners, RowRule::words};
  if (std::ranges::find(kWithoutRemarks, layout_.shape.rule) != std::end(kWithoutRemarks)) return result;
  std::vector<std::uint64_t> remarks(block_count());
  for_each_block(remarks.size(), [&](std::size_t block) {
    for_each_line(block, [&](std::string_view line, std::ptrdiff_t) {
      remarks[block] += is_row(line, RowRule::filled) && !is_row(line, RowRule::uncommented);
    });
    release(block_text(block));
  });
  const std::uint64_t all = std::accumulate(remarks.begin(), remarks.end(), std::uint64_t{0});
  if (all > 0) result.push_back({ContentKind::comments, counted(all, "comment")});
  return result;
}

}  // namespace pointfair::io
