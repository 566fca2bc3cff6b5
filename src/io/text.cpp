// SPDX-License-Identifier: Apache-2.0
#include "io/text.hpp"

#include <fast_float/fast_float.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>

namespace pointfair::io {
namespace {

template <class T>
void append_chars(std::string& to, T value) {
  char digits[32];
  to.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

}  // namespace

const char* end_of_quotes(const char* at, const char* end) {
  for (const char* c = at + 1; c < end; ++c) {
    if (*c != '"') continue;
    if (c + 1 == end || c[1] != '"') return c + 1;
    ++c;
  }
  return at;
}

bool next_separated_word(std::string_view& line, std::string_view& word, char separator) {
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at != end && is_blank(*at) && *at != separator) ++at;
  if (at == end) {
    line = {end, 0};
    return false;
  }
  const char* begin = at;
  if (*at == '"') at = end_of_quotes(at, end);
  const char* const quotes_end = at;
  while (at != end && *at != separator) ++at;
  const char* last = at;
  while (last != begin && is_blank(last[-1])) --last;
  if (at != end) ++at;
  if (quotes_end != begin && quotes_end == last) ++begin, --last;
  word = {begin, static_cast<std::size_t>(last - begin)};
  line = {at, static_cast<std::size_t>(end - at)};
  return true;
}

bool next_quoted_word(std::string_view& line, std::string_view& word) {
  const char* const end = line.data() + line.size();
  const char* const begin = line.data() + line.find('"');
  const char* const quotes_end = end_of_quotes(begin, end);
  const char* at = quotes_end;
  while (at != end && !is_blank(*at)) ++at;
  const bool quoted = quotes_end != begin && quotes_end == at;
  word = quoted ? std::string_view(begin + 1, static_cast<std::size_t>(at - begin - 2))
                : std::string_view(begin, static_cast<std::size_t>(at - begin));
  line = {at, static_cast<std::size_t>(end - at)};
  return true;
}

std::size_t byte_order_mark(std::string_view text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  return text.starts_with(kMark) ? kMark.size() : 0;
}

char line_end_of(std::string_view text) {
  constexpr std::size_t kFront = 65536;
  const std::size_t end = text.substr(0, kFront).find_first_of("\r\n");
  const bool alone =
      end != std::string_view::npos && text[end] == '\r' && end + 1 < text.size() && text[end + 1] != '\n';
  return alone ? '\r' : '\n';
}

bool next_line(std::string_view& text, std::string_view& line, char line_end) {
  if (text.empty()) return false;
  const std::size_t end = text.find(line_end);
  line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return true;
}

namespace {

// Of words that blanks separate: several numbers, and commas in them only.
bool has_decimal_commas(std::string_view line) {
  std::size_t words = 0, commas = 0;
  for (std::string_view word; next_word(line, word); ++words) {
    if (is_comma_number(word)) {
      ++commas;
    } else if (word.find(',') != std::string_view::npos || !to_number(word)) {
      return false;
    }
  }
  return words >= 3 && commas > 0;
}

}  // namespace

char separator_of(std::string_view line) {
  bool comma = false;
  const char* const end = line.data() + line.size();
  for (const char* at = line.data(); at != end;) {
    const char* const behind = *at == '"' ? end_of_quotes(at, end) : at;
    if (*at == ';') return ';';
    comma = comma || *at == ',';
    at = behind == at ? at + 1 : behind;
  }
  return comma && !has_decimal_commas(line) ? ',' : ' ';
}

bool ends_with_separator(std::string_view line, char separator) {
  if (separator == ' ') return false;
  while (!line.empty() && is_blank(line.back()) && line.back() != separator) line.remove_suffix(1);
  return line.ends_with(separator);
}

std::vector<std::string_view> words_of(std::string_view line, char separator) {
  const std::string_view whole = line;
  std::vector<std::string_view> words;
  for (std::string_view word; next_word(line, word, separator);) words.push_back(word);
  if (ends_with_separator(whole, separator)) words.emplace_back(line.data(), 0);
  return words;
}

std::string listed_numbers(std::span<const double> values, int digits) {
  std::string list;
  for (const double value : values) {
    char text[32];
    const int length = std::snprintf(text, sizeof text, "%.*g", digits, value + 0.0);  // no -0
    if (!list.empty()) list += ", ";
    list.append(text, static_cast<std::size_t>(length));
  }
  return list;
}

std::string_view without_blanks(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string lower_case(std::string_view word) {
  std::string lower(word);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

std::string upper_case(std::string_view word) {
  std::string upper(word);
  for (char& c : upper)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return upper;
}

namespace {

// What C libraries of Microsoft print, "1.#QNAN", "-1.#IND00", "1.#INF", and what stands for a missing number.
std::optional<double> not_finite(std::string_view word) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinite = std::numeric_limits<double>::infinity();
  constexpr std::string_view kMissing[] = {"NA", "N/A", "n/a", "#N/A", "null", "NULL", "None"};
  if (std::ranges::find(kMissing, word) != std::end(kMissing)) return kNan;
  const bool negative = word.starts_with('-');
  if (negative || word.starts_with('+')) word.remove_prefix(1);
  if (!word.starts_with("1.#")) return std::nullopt;
  word.remove_prefix(3);
  if (word.starts_with("INF")) return negative ? -kInfinite : kInfinite;
  const bool known = word.starts_with("QNAN") || word.starts_with("SNAN") || word.starts_with("IND");
  return known ? std::optional(kNan) : std::nullopt;
}

// Exponents of Fortran, "1.5D+02"; thousands as the Swiss group them, "2'600'123.4"; the minus sign of typesetters.
std::optional<double> unusual_number(std::string_view word) {
  constexpr std::string_view kMinus = "\xE2\x88\x92";
  std::string plain;
  bool changed = word.starts_with(kMinus);
  if (changed) {
    plain = "-";
    word.remove_prefix(kMinus.size());
  }
  const auto is_digit = [&](std::size_t at) { return at < word.size() && word[at] >= '0' && word[at] <= '9'; };
  for (std::size_t i = 0; i < word.size(); ++i) {
    const bool behind_number = i > 0 && (is_digit(i - 1) || word[i - 1] == '.');
    const bool exponent = (word[i] == 'D' || word[i] == 'd') && behind_number;
    const bool group = word[i] == '\'' && behind_number && is_digit(i + 1) && is_digit(i + 2) && is_digit(i + 3);
    changed = changed || exponent || group;
    if (!group) plain += exponent ? 'e' : word[i];
  }
  return changed ? to_number(plain) : std::nullopt;
}

}  // namespace

// Apart, so that the usual case stays small.
[[gnu::noinline]] static std::optional<double> other_number(std::string_view word) {
  if (word.empty() || word.size() > 64) return std::nullopt;
  const auto value = not_finite(word);
  return value ? value : unusual_number(word);
}

// Not inlined here, so that it takes in the parser of its only call.
[[gnu::noinline]] std::optional<double> to_number(std::string_view word) {
  const char* begin = word.data();
  const char* const end = begin + word.size();
  if (word.size() > 1 && *begin == '+' && begin[1] != '-') ++begin;
  double value = 0;
  const auto [stop, error] = fast_float::from_chars(begin, end, value);
  if (error == std::errc::invalid_argument || stop != end) return other_number(word);
  return value;
}

bool is_comma_number(std::string_view word) {
  const std::size_t comma = word.find(',');
  const auto is_digit = [&](std::size_t at) { return at < word.size() && word[at] >= '0' && word[at] <= '9'; };
  if (comma == std::string_view::npos || comma == 0 || !is_digit(comma - 1) || !is_digit(comma + 1)) return false;
  std::string plain(word);
  plain[comma] = '.';
  return to_number(plain).has_value();
}

std::optional<std::uint64_t> to_count(std::string_view word) {
  std::uint64_t value = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || stop != word.data() + word.size()) return std::nullopt;
  return value;
}

bool to_integer(std::string_view word, NativeType type, char* to) {
  return with_type(type, [&](auto value) {
    if constexpr (std::is_integral_v<decltype(value)>) {
      if (word.starts_with('+')) word.remove_prefix(1);
      const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
      std::memcpy(to, &value, sizeof value);
      return error == std::errc() && stop == word.data() + word.size();
    }
    return false;
  });
}

int decimals_of(std::string_view word) {
  const std::size_t point = word.find('.');
  const std::size_t digits = point == std::string_view::npos ? word.size() : point + 1;
  const std::string_view fraction = word.substr(digits);
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const std::string_view whole = word.substr(0, point == std::string_view::npos ? word.size() : point);
  const auto whole_digits = whole.substr(whole.empty() || is_digit(whole[0]) ? 0 : 1);
  if (!std::ranges::all_of(fraction, is_digit)) return -1;
  if (!std::ranges::all_of(whole_digits, is_digit)) return -1;
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
  std::uint64_t lines = 1;
  const char* const end = text.data() + text.size();
  for (const char* c = text.data(); c < at; ++c) lines += *c == '\n' || (*c == '\r' && c + 1 < end && c[1] != '\n');
  return lines;
}

std::string quoted(std::string_view word) {
  std::string shown(word.substr(0, 40));
  for (char& c : shown)
    if (static_cast<unsigned char>(c) < 32) c = '?';
  return "'" + shown + (word.size() > 40 ? "...'" : "'");
}

}  // namespace pointfair::io
