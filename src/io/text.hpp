// SPDX-License-Identifier: Apache-2.0
// Words and numbers in lines of text. Words are separated by blanks, or by one comma, semicolon or tab with blanks
// around it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/scalar.hpp"

namespace pointfair::io {

/// A row may go on over several lines, so their ends are blanks, too.
constexpr bool is_blank(char c) {
  constexpr std::uint64_t kBlanks = 1ULL << ' ' | 1ULL << '\t' | 1ULL << '\r' | 1ULL << '\n';
  return static_cast<unsigned char>(c) <= ' ' && (kBlanks >> c & 1) != 0;
}

/// Where the quotes end that begin at `at`, behind them; `at` itself if they do not. Two quotes within stand for one.
const char* end_of_quotes(const char* at, const char* end);

// The rarer parts of next_word().
bool next_separated_word(std::string_view& line, std::string_view& word, char separator);
bool next_quoted_word(std::string_view& line, std::string_view& word);

/// Takes the next word off the front of `line`. Words are separated by blanks; or, if `separator` is none, by one such
/// character, with blanks around it, and then a word may be empty. The word in quotes is what they enclose. False:
/// there is none left.
inline bool next_word(std::string_view& line, std::string_view& word, char separator = ' ') {
  const char* at = line.data();
  const char* const end = at + line.size();
  if (separator != ' ') return next_separated_word(line, word, separator);
  while (at != end && is_blank(*at)) ++at;
  if (at == end) {
    line = {end, 0};
    return false;
  }
  if (*at == '"') return next_quoted_word(line, word);
  const char* const begin = at;
  while (at != end && !is_blank(*at)) ++at;
  word = {begin, static_cast<std::size_t>(at - begin)};
  line = {at, static_cast<std::size_t>(end - at)};
  return true;
}

/// What separates the words of a line: ';' or ',' if there is one outside of quotes, else ' '. Commas within the
/// numbers of words that blanks separate are decimal commas.
char separator_of(std::string_view line);

/// Whether the line ends with a separator that is no blank, and so with an empty word that next_word() does not give.
bool ends_with_separator(std::string_view line, char separator);

/// The byte order mark of UTF-8, which some programs write at the front of a text.
std::size_t byte_order_mark(std::string_view text);

/// What ends the lines of a text: '\r' in the way of old Macs, else '\n'. Text that begins behind binary data is not
/// looked at.
char line_end_of(std::string_view text);

/// Takes the next line off the front of `text`; the line keeps its '\r' but not its end. False: the text is empty.
bool next_line(std::string_view& text, std::string_view& line, char line_end = '\n');

std::vector<std::string_view> words_of(std::string_view line, char separator = ' ');
std::string lower_case(std::string_view word);
std::string upper_case(std::string_view word);

/// The number that the whole word spells ("1", "-.5", "+1e-3", "nan", "inf", "1.#QNAN" of old C libraries, "NA"), or
/// nothing.
std::optional<double> to_number(std::string_view word);
/// Whether the word is a number with a decimal comma: one comma between digits.
bool is_comma_number(std::string_view word);
std::optional<std::uint64_t> to_count(std::string_view word);

/// Stores a whole number with all its digits as `type`. False: the word is none, or out of range.
bool to_integer(std::string_view word, NativeType type, char* to);

/// Decimals of a number in plain notation; -1 for one with an exponent, or not finite.
int decimals_of(std::string_view word);

/// The shortest text that reads back as the same value of its type.
void append_number(std::string& to, double value);
void append_number(std::string& to, float value);
void append_scalar(std::string& to, const char* from, NativeType type);
void append_as(std::string& to, double value, NativeType type);

/// Numbers for people, with so many digits and commas between them.
std::string listed_numbers(std::span<const double> values, int digits);

/// Without the blanks at both ends.
std::string_view without_blanks(std::string_view text);

/// A coordinate that moved, in place of `word`: no fewer decimals than the word had, and enough to resolve a tenth of
/// the last bit of `offset`, the coordinate as a float relative to the cloud's origin.
void append_moved(std::string& to, std::string_view word, double value, float offset);

/// A copy of a text with others in the place of some words, which are given as they stand in it.
class PatchedText {
 public:
  PatchedText(std::string_view text, std::string& to) : at_(text.data()), end_(at_ + text.size()), to_(to) {}

  void copy_up_to(const char* end) {
    to_.append(at_, end);
    at_ = end;
  }
  void replace(std::string_view word, std::string_view by) {
    copy_up_to(word.data());
    to_ += by;
    at_ += word.size();
  }
  void finish() { copy_up_to(end_); }

 private:
  const char *at_, *end_;
  std::string& to_;
};

/// The number, from 1, of the line of `text` in which `at` lies, whatever ends the lines.
std::uint64_t line_number(std::string_view text, const char* at);

/// The word as it may appear in a message: quoted, cut, without control characters.
std::string quoted(std::string_view word);

}  // namespace pointfair::io
