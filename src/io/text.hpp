// SPDX-License-Identifier: Apache-2.0
// Words and numbers in lines of text. Words are separated by blanks, or by one comma or semicolon with blanks around
// it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/scalar.hpp"

namespace pointfair::io {

constexpr bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

/// Takes the next word off the front of `line`. Words are separated by blanks; or, if `separator` is none, by one such
/// character, with blanks around it, and then a word may be empty, or quoted. False: there is none left.
inline bool next_word(std::string_view& line, std::string_view& word, char separator = ' ') {
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at != end && is_blank(*at)) ++at;
  if (at == end) {
    line = {end, 0};
    return false;
  }
  const char* const begin = at;
  if (separator == ' ') {
    while (at != end && !is_blank(*at)) ++at;
    word = {begin, static_cast<std::size_t>(at - begin)};
    line = {at, static_cast<std::size_t>(end - at)};
    return true;
  }
  if (*at == '"') {
    do ++at;
    while (at != end && *at != '"');
  }
  while (at != end && *at != separator) ++at;
  const char* last = at;
  while (last != begin && is_blank(last[-1])) --last;
  word = {begin, static_cast<std::size_t>(last - begin)};
  if (at != end) ++at;
  line = {at, static_cast<std::size_t>(end - at)};
  return true;
}

/// What separates the words of a line: ';' or ',' if there is one, else ' '.
char separator_of(std::string_view line);

/// Takes the next line off the front of `text`; the line keeps its '\r' but not its '\n'. False: the text is empty.
bool next_line(std::string_view& text, std::string_view& line);

std::vector<std::string_view> words_of(std::string_view line, char separator = ' ');
std::string lower_case(std::string_view word);

/// The number that the whole word spells ("1", "-.5", "+1e-3", "nan", "inf"), or nothing.
std::optional<double> to_number(std::string_view word);
std::optional<std::uint64_t> to_count(std::string_view word);

/// Decimals of a number in plain notation; -1 for one with an exponent, or not finite.
int decimals_of(std::string_view word);

/// The shortest text that reads back as the same value of its type.
void append_number(std::string& to, double value);
void append_number(std::string& to, float value);
void append_scalar(std::string& to, const char* from, NativeType type);
void append_as(std::string& to, double value, NativeType type);

/// A coordinate that moved, in place of `word`: no fewer decimals than the word had, and enough to resolve a tenth of
/// the last bit of `offset`, the coordinate as a float relative to the cloud's origin.
void append_moved(std::string& to, std::string_view word, double value, float offset);

/// The number, from 1, of the line of `text` in which `at` lies.
std::uint64_t line_number(std::string_view text, const char* at);

/// The word as it may appear in a message: quoted, cut, without control characters.
std::string quoted(std::string_view word);

}  // namespace pointfair::io
