// SPDX-License-Identifier: Apache-2.0
// The types of columns of text, and what a text holds beside numbers: by all its words.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>

#include "io/parallel.hpp"
#include "io/plain_row.hpp"
#include "io/row_words.hpp"
#include "io/text_source.hpp"
#include "portable.hpp"

namespace pointfair::io {

/// The power of ten of a number's last digit: -2 for 1.25, 1 for 1.2e2.
static int last_place_of(std::string_view word) {
  const std::size_t mark = std::min(word.find_first_of("eEdD"), word.size());
  const std::size_t point = word.substr(0, mark).find('.');
  int exponent = 0;
  if (mark < word.size()) {
    const std::size_t first = mark + 1 + word.substr(mark + 1).starts_with('+');
    std::from_chars(word.data() + first, word.data() + word.size(), exponent);
  }
  return std::clamp(exponent, -400, 400) - static_cast<int>(point < mark ? mark - point - 1 : 0);
}

/// What the numbers of a column have in common, and so the narrowest type that holds them without losing a digit.
struct Narrowest {
  bool numbers = true, integers = true, fits_float = true;
  bool filled = false;  ///< some word is not empty
  bool fits_int64 = true, fits_uint64 = true;
  bool has_wide = false;  ///< some whole number has more digits than a double
  double low = 0, high = 0;

  /// `decimal`: what stands before the decimals.
  void see(std::string_view word, char decimal = '.') {
    if (word.empty()) {
      integers = false;
      return;
    }
    filled = true;
    if (see_short_number(word)) return;
    if (decimal != '.' && word.find(decimal) != std::string_view::npos) {
      std::string plain(word);
      std::ranges::replace(plain, decimal, '.');
      return see(plain);
    }
    const std::optional<double> value = to_number(word);
    if (!value) {
      numbers = integers = false;
      return;
    }
    const int decimals = decimals_of(word);
    integers = integers && decimals == 0 && !(*value == 0 && std::signbit(*value));  // no integer is -0
    low = std::min(low, *value);
    high = std::max(high, *value);
    if (!std::isfinite(*value)) return;
    if (decimals == 0 && std::abs(*value) > kExactIntegers) {
      has_wide = true;
      see_digits(word);
    }
    // A float suffices if, printed with as many digits, it gives the same word.
    const double error = std::abs(static_cast<double>(static_cast<float>(*value)) - *value);
    fits_float = fits_float && (error == 0 || error < 0.5 * portable::power_of_ten(last_place_of(word)));
  }
  void merge(const Narrowest& other) {
    numbers = numbers && other.numbers;
    integers = integers && other.integers;
    fits_float = fits_float && other.fits_float;
    filled = filled || other.filled;
    fits_int64 = fits_int64 && other.fits_int64;
    fits_uint64 = fits_uint64 && other.fits_uint64;
    has_wide = has_wide || other.has_wide;
    low = std::min(low, other.low);
    high = std::max(high, other.high);
  }
  NativeType type() const {
    if (integers && low >= 0 && high <= 255) return NativeType::uint8;
    if (integers && low >= std::numeric_limits<std::int32_t>::min() && high <= std::numeric_limits<std::int32_t>::max())
      return NativeType::int32;
    if (integers && std::max(-low, high) > kExactIntegers && fits_int64) return NativeType::int64;
    if (integers && high > kExactIntegers && low >= 0 && fits_uint64) return NativeType::uint64;
    return fits_float ? NativeType::float32 : NativeType::float64;
  }

 private:
  static constexpr double kExactIntegers = 9007199254740992.0;  // 2^53, beyond which doubles leave some out

  // The usual words of colours, classes and intensities. False: look closer. With fewer than 2^23 units of its last
  // decimal, a number is less than half a unit from a float; then nothing but that it is no integer is at stake.
  bool see_short_number(std::string_view word) {
    constexpr std::size_t kMostDigits = 7;
    constexpr int kUnits = 1 << 23;
    int value = 0;
    std::size_t digits = 0, point = word.size();
    for (std::size_t i = word.starts_with('-'); i < word.size(); ++i) {
      if (word[i] == '.' && point == word.size()) {
        point = i;
        continue;
      }
      if (word[i] < '0' || word[i] > '9' || ++digits > kMostDigits) return false;
      value = 10 * value + (word[i] - '0');
    }
    if (point == word.size()) {
      if (word[0] == '-' || digits == 0) return false;
      high = std::max<double>(high, value);
      return true;
    }
    if (value >= kUnits || point + 1 == word.size() || digits == 0) return false;
    integers = false;
    return true;
  }

  void see_digits(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    std::int64_t with_sign = 0;
    std::uint64_t without = 0;
    fits_int64 = fits_int64 && std::from_chars(word.data(), word.data() + word.size(), with_sign).ec == std::errc();
    fits_uint64 = fits_uint64 && std::from_chars(word.data(), word.data() + word.size(), without).ec == std::errc();
  }
};

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
  const bool all = std::ranges::all_of(seen, &Narrowest::fits_float);
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
      std::ranges::find_if(owner, [&](std::size_t a) { return a < seen.size(); }) - owner.begin());
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
  if (std::ranges::all_of(attributes_, is_known)) return;
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
