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
    for (std::string_view passed; words > 0; --words)
      if (!word(passed)) return false;
    return true;
  }

  bool number(double& value) {
    const auto [stop, error] = fast_float::from_chars(at_, end_, value);
    if (error != std::errc()) return false;
    at_ = stop;
    if (at_ == end_) return true;
    if (by_blanks_ && !is_blank(*at_)) return false;
    skip_blanks();
    if (!by_blanks_ && at_ != end_ && *at_ != separator_) return false;
    end_word();
    return true;
  }

  bool position(Position& to) { return number(to[0]) && number(to[1]) && number(to[2]); }

  /// Whether blanks separate its words and none is left.
  bool is_at_end() const { return at_ == end_ && by_blanks_; }

 private:
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
  void skip_blanks() {
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
