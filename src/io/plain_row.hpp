// SPDX-License-Identifier: Apache-2.0
// The usual row of a text, in one pass: words without quotes, between blanks or between single separators.
#pragma once

#include <fast_float/fast_float.h>

#include <bit>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <system_error>

#include "io/text.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io {

/// Takes words and numbers off the front of a row. What is not usual it does not take: quotes, a sign '+', a decimal
/// comma, a row that goes on in the next line. Then RowWords says what the row holds.
class PlainRow {
 public:
  /// `separator`: as next_word() has it.
  PlainRow(std::string_view line, char separator)
      : at_(line.data()), end_(line.data() + line.size()), separator_(separator), by_blanks_(separator == ' ') {
    skip_blanks();
  }

  bool word(std::string_view& word) {
    const char* const begin = at_;
    if (at_ == end_ || *at_ == '"') return false;
    if (by_blanks_) {
      at_ = end_of_word(at_, end_);
    } else {
      while (at_ != end_ && *at_ != separator_) ++at_;
    }
    const char* last = at_;
    while (!by_blanks_ && last != begin && is_blank(last[-1])) --last;
    if (last != begin && last[-1] == '\\') {
      at_ = begin;  // not the end of the row
      return false;
    }
    word = {begin, static_cast<std::size_t>(last - begin)};
    end_word();
    return true;
  }

  bool skip(std::size_t words) {
    if (words > 1 && skip_usual(words)) return true;
    for (std::string_view passed; words > 0; --words)
      if (!word(passed)) return false;
    return true;
  }

  /// A whole number of at most three digits, as those of colours. False: look closer.
  bool short_count(unsigned& value) {
    constexpr std::ptrdiff_t kMostDigits = 3;
    const char* at = at_;
    for (value = 0; at != end_ && static_cast<unsigned char>(*at - '0') < 10; ++at) {
      if (at - at_ == kMostDigits) return false;
      value = 10 * value + static_cast<unsigned char>(*at - '0');
    }
    if (at == at_ || (at != end_ && (!by_blanks_ || !is_blank(*at)))) return false;
    at_ = at;
    skip_blanks();
    return true;
  }

  bool number(double& value) {
    const char* const begin = at_;
    if (!short_number(value)) {
      const auto [stop, error] = fast_float::from_chars(at_, end_, value);
      if (error != std::errc()) return false;
      at_ = stop;
    }
    if (at_ == end_) return true;
    const bool has_blank = is_blank(*at_);
    skip_blanks();
    if (by_blanks_ ? !has_blank : at_ != end_ && *at_ != separator_) {
      at_ = begin;  // it is no number
      return false;
    }
    end_word();
    return true;
  }

  bool position(Position& to) { return number(to[0]) && number(to[1]) && number(to[2]); }

  /// Whether blanks separate its words and none is left.
  bool is_at_end() const { return at_ == end_ && by_blanks_; }

 private:
  // The bytes that are at most ' ', by their high bits.
  static std::uint64_t blanks_in(std::uint64_t bytes) {
    return ~(((bytes & 0x7f7f7f7f7f7f7f7fU) + 0x5f5f5f5f5f5f5f5fU) | bytes) & 0x8080808080808080U;
  }
  static std::uint64_t bytes_at(const char* at) {
    std::uint64_t bytes = 0;
    std::memcpy(&bytes, at, sizeof bytes);
    return bytes;
  }

  // A number of at most eight digits between blanks, without an exponent, all digits at once. They and the power of ten
  // are doubles, so that their quotient is the double next to the number. False: look closer.
  bool short_number(double& value) {
    constexpr std::ptrdiff_t kRead = 17;  // characters, at most
    constexpr double kPowersOfTen[] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8};
    if (!by_blanks_ || std::endian::native != std::endian::little || end_ - at_ <= kRead) return false;
    const bool is_negative = *at_ == '-';
    const char* const at = at_ + is_negative;
    const std::uint64_t front = bytes_at(at), blanks = blanks_in(front);
    const int length = blanks != 0 ? std::countr_zero(blanks) / 8 : is_blank(at[8]) ? 8 : 9;
    if (!is_blank(at[length])) return false;
    // high bits of points, exact up to the first one
    const std::uint64_t from_point = front ^ 0x2e2e2e2e2e2e2e2eU;
    const std::uint64_t points = (from_point - 0x0101010101010101U) & ~from_point & 0x8080808080808080U;
    const int whole = points != 0 ? std::countr_zero(points) / 8 : 8;
    const bool has_point = whole < length && points != 0;
    const int digits = has_point ? length - 1 : length;
    if (digits == 0 || digits > 8) return false;
    std::uint64_t text = front;
    if (has_point) text = (front & ((std::uint64_t{1} << 8 * whole) - 1)) | bytes_at(at + whole + 1) << 8 * whole;
    const int filled = 8 * (8 - digits);  // bits, with zeros before the number
    text <<= filled;
    if (filled > 0) text |= 0x3030303030303030U >> (64 - filled);
    if (((text & 0xf0f0f0f0f0f0f0f0U) | ((text + 0x0606060606060606U) & 0xf0f0f0f0f0f0f0f0U) >> 4) !=
        0x3333333333333333U)
      return false;
    text -= 0x3030303030303030U;
    text = text * 10 + (text >> 8);  // pairs of digits, then fours, then all
    constexpr std::uint64_t kPairs = 0x000000ff000000ffU;
    text = ((text & kPairs) * 0x000f424000000064U + (text >> 16 & kPairs) * 0x0000271000000001U) >> 32;
    value = static_cast<double>(static_cast<std::uint32_t>(text));
    if (has_point) value /= kPowersOfTen[length - 1 - whole];
    if (is_negative) value = -value;
    at_ = at + length;
    return true;
  }

  // Eight characters at a time: most of the time of a row goes into passing words.
  static const char* end_of_word(const char* at, const char* end) {
    if constexpr (std::endian::native == std::endian::little) {
      for (std::uint64_t bytes = 0; end - at >= 8;) {
        std::memcpy(&bytes, at, 8);
        // the high bits of bytes that are at most ' '; exact up to the first one
        const std::uint64_t low = (bytes - 0x2121212121212121U) & ~bytes & 0x8080808080808080U;
        at += low == 0 ? 8 : std::countr_zero(low) / 8;
        if (low == 0) continue;
        if (is_blank(*at)) return at;
        ++at;
      }
    }
    while (at != end && !is_blank(*at)) ++at;
    return at;
  }
  // Words that single blanks separate, eight characters at a time. False: look closer, from the same place.
  bool skip_usual(std::size_t words) {
    if (!by_blanks_ || std::endian::native != std::endian::little || at_ == end_ || *at_ == '"') return false;
    for (const char* at = at_; end_ - at > 8; at += 8) {
      for (std::uint64_t blanks = blanks_in(bytes_at(at)); blanks != 0; blanks &= blanks - 1) {
        const char* const blank = at + std::countr_zero(blanks) / 8;
        if (!is_blank(*blank) || blank == at_ || blank[-1] == '\\' || is_blank(blank[1]) || blank[1] == '"')
          return false;
        if (--words > 0) continue;
        at_ = blank + 1;
        return true;
      }
    }
    return false;
  }
  [[gnu::always_inline]] void skip_blanks() {
    while (at_ != end_ && is_blank(*at_) && (by_blanks_ || *at_ != separator_)) ++at_;
  }
  void end_word() {
    if (!by_blanks_ && at_ != end_) ++at_;
    skip_blanks();
  }

  const char* at_;
  const char* end_;
  char separator_;
  bool by_blanks_;
};

}  // namespace pointfair::io
