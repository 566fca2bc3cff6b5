// SPDX-License-Identifier: Apache-2.0
#include "io/text.hpp"

#include <fast_float/fast_float.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>

namespace pointfair::io {
namespace {

template <class T>
void append_chars(std::string& to, T value) {
  char digits[32];
  to.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

}  // namespace

bool next_line(std::string_view& text, std::string_view& line) {
  if (text.empty()) return false;
  const std::size_t end = text.find('\n');
  line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return true;
}

char separator_of(std::string_view line) {
  for (const char separator : {';', ','}) {
    if (line.find(separator) != std::string_view::npos) return separator;
  }
  return ' ';
}

std::vector<std::string_view> words_of(std::string_view line, char separator) {
  std::vector<std::string_view> words;
  for (std::string_view word; next_word(line, word, separator);) words.push_back(word);
  return words;
}

std::string lower_case(std::string_view word) {
  std::string lower(word);
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return lower;
}

std::optional<double> to_number(std::string_view word) {
  const char* begin = word.data();
  const char* const end = begin + word.size();
  if (word.size() > 1 && *begin == '+' && begin[1] != '-') ++begin;
  double value = 0;
  const auto [stop, error] = fast_float::from_chars(begin, end, value);
  if (error == std::errc::invalid_argument || stop != end) return std::nullopt;
  return value;
}

std::optional<std::uint64_t> to_count(std::string_view word) {
  std::uint64_t value = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || stop != word.data() + word.size()) return std::nullopt;
  return value;
}

int decimals_of(std::string_view word) {
  const std::size_t point = word.find('.');
  const std::size_t digits = point == std::string_view::npos ? word.size() : point + 1;
  const std::string_view fraction = word.substr(digits);
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const std::string_view whole = word.substr(0, point == std::string_view::npos ? word.size() : point);
  const auto whole_digits = whole.substr(whole.empty() || is_digit(whole[0]) ? 0 : 1);
  if (!std::all_of(fraction.begin(), fraction.end(), is_digit)) return -1;
  if (!std::all_of(whole_digits.begin(), whole_digits.end(), is_digit)) return -1;
  return static_cast<int>(std::min<std::size_t>(fraction.size(), 40));
}

void append_number(std::string& to, double value) { append_chars(to, value); }
void append_number(std::string& to, float value) { append_chars(to, value); }

void append_scalar(std::string& to, const char* from, NativeType type) {
  with_type(type, [&](auto tag) {
    const auto value = load<decltype(tag)>(from, false);
    if constexpr (sizeof value == 1) {
      append_chars(to, static_cast<int>(value));  // a number, not a character
    } else {
      append_chars(to, value);
    }
  });
}

void append_as(std::string& to, double value, NativeType type) {
  char stored[8];
  store_double(stored, type, false, value);
  append_scalar(to, stored, type);
}

void append_moved(std::string& to, std::string_view word, double value, float offset) {
  const int had = decimals_of(word);
  const double size = std::abs(value);
  if (had < 0 || !(size < 1e15) || size < 1e-5) return append_chars(to, value);
  // One unit in the last place of a float of this size is 2^(exponent - 23).
  const int last_bit = std::ilogb(std::max(std::abs(offset), 1e-5F)) - 23;
  const int needed = static_cast<int>(std::ceil(-last_bit * 0.30103)) + 1;
  const int decimals = std::clamp(std::max(had, needed), 0, 40);
  char digits[64];
  char* end = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed, decimals).ptr;
  for (int extra = decimals - had; extra > 0 && end[-1] == '0'; --extra) --end;
  if (end[-1] == '.') --end;
  to.append(digits, end);
}

std::uint64_t line_number(std::string_view text, const char* at) {
  return 1 + static_cast<std::uint64_t>(std::count(text.data(), at, '\n'));
}

std::string quoted(std::string_view word) {
  std::string shown(word.substr(0, 40));
  for (char& c : shown) {
    if (static_cast<unsigned char>(c) < 32) c = '?';
  }
  return "'" + shown + (word.size() > 40 ? "...'" : "'");
}

}  // namespace pointfair::io
