// SPDX-License-Identifier: Apache-2.0
// The lines of an OBJ file, and the corners of its faces.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "io/obj_parts.hpp"
#include "io/text.hpp"
#include "io/text_rows.hpp"

namespace pointfair::io {

enum class ObjLine : std::uint8_t { point, normal, texture, face, other, blank };

// What a line is; its key goes off its front with the blanks before, but that of other lines stays.
inline ObjLine take_key(std::string_view& line) {
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at != end && is_blank(*at)) ++at;
  line = {at, static_cast<std::size_t>(end - at)};
  if (at == end) return ObjLine::blank;
  const bool one = at + 1 == end || is_blank(at[1]), two = !one && (at + 2 == end || is_blank(at[2]));
  ObjLine kind = ObjLine::other;
  if (one && *at == 'f') kind = ObjLine::face;
  if (one && *at == 'v' && at + 1 != end) kind = ObjLine::point;  // as RowRule::vertices has it
  if (two && *at == 'v' && at[1] == 'n') kind = ObjLine::normal;
  if (two && *at == 'v' && at[1] == 't') kind = ObjLine::texture;
  if (kind != ObjLine::other) line.remove_prefix(one ? 1 : 2);
  return kind;
}

// Calls take(kind, words, line) for each line that is not blank; `words` follow the key, unless the kind is other.
template <class Take>
void for_each_line(const ObjText& text, const Take& take) {
  constexpr std::ptrdiff_t kPassed = std::ptrdiff_t{1} << 20;  // bytes at a time
  std::string_view rest = text.rows, line;
  const char* passed = rest.data();
  while (next_row(rest, line, text.shape)) {
    std::string_view words = line;
    const ObjLine kind = take_key(words);
    if (kind != ObjLine::blank) take(kind, words, line);
    if (rest.data() - passed < kPassed) continue;
    text.passed({passed, static_cast<std::size_t>(rest.data() - passed)});
    passed = rest.data();
  }
}

// The lines before a face, from which negative indices count.
struct LinesSoFar {
  std::uint64_t points = 0, normals = 0, textures = 0;

  void take(ObjLine kind) {
    points += kind == ObjLine::point;
    normals += kind == ObjLine::normal;
    textures += kind == ObjLine::texture;
  }
};

// One corner of a face, from 0; none is -1.
struct Corner {
  std::int64_t point = -1, texture = -1, normal = -1;
  std::string_view point_text, normal_text;  // the numbers as they stand there
};

// The corners of one face: "7", "7/1", "7//3", "7/1/3", and "-1" for the last so far.
class Corners {
 public:
  Corners(std::string_view words, const LinesSoFar& so_far, std::uint64_t points)
      : at_(words.data()), end_(at_ + words.size()), so_far_(so_far), points_(points) {}

  // False: there is none left, or the next one is damaged.
  bool next(Corner& corner) {
    skip_blanks();
    if (at_ == end_) return false;
    constexpr std::uint64_t kMost = std::uint64_t{1} << 31;
    word_ = at_;
    corner = {};
    const auto text_from = [&](const char* begin) {
      return std::string_view(begin, static_cast<std::size_t>(at_ - begin));
    };
    if (!index(so_far_.points, points_, corner.point)) return damage();
    corner.point_text = text_from(word_);
    if (take_slash() && !is_left_out() && !index(so_far_.textures, kMost, corner.texture)) return damage();
    const bool has_normal = take_slash() && !is_left_out();
    const char* const normal = at_;
    if (has_normal && !index(so_far_.normals, kMost, corner.normal)) return damage();
    corner.normal_text = text_from(normal);
    if (take_slash()) skip_word();  // what else may stand there
    while (at_ != end_ && *at_ == '\\') ++at_;
    return at_ == end_ || is_blank(*at_) || damage();
  }

  // The word that is no corner, if there is one.
  std::optional<std::string_view> damaged() const {
    if (!damaged_) return std::nullopt;
    std::string_view rest(word_, static_cast<std::size_t>(end_ - word_)), word;
    next_word(rest, word);
    while (word.size() > 1 && word.ends_with('\\')) word.remove_suffix(1);
    return word;
  }

 private:
  bool damage() {
    damaged_ = true;
    return false;
  }
  // A backslash says that the row goes on in the next line.
  void skip_blanks() {
    while (at_ != end_ && is_blank(*at_)) ++at_;
    const char* at = at_;
    while (at != end_ && *at == '\\') ++at;
    if (at == at_ || (at != end_ && !is_blank(*at))) return;
    at_ = at;
    skip_blanks();
  }
  void skip_word() {
    while (at_ != end_ && !is_blank(*at_)) ++at_;
  }
  bool take_slash() {
    if (at_ == end_ || *at_ != '/') return false;
    ++at_;
    return true;
  }
  bool is_left_out() const { return at_ == end_ || *at_ == '/' || *at_ == '\\' || is_blank(*at_); }

  bool index(std::uint64_t so_far, std::uint64_t most, std::int64_t& to) {
    constexpr std::ptrdiff_t kDigits = 18;  // fit
    const bool from_last = at_ != end_ && *at_ == '-';
    at_ += from_last;
    const char* const begin = at_;
    std::int64_t number = 0;
    for (; at_ != end_ && *at_ >= '0' && *at_ <= '9' && at_ - begin < kDigits; ++at_)
      number = 10 * number + (*at_ - '0');
    if (at_ == begin) return false;
    if (number == 0) return false;
    if (from_last) number = static_cast<std::int64_t>(so_far) + 1 - number;
    to = number - 1;
    return number >= 1 && static_cast<std::uint64_t>(number) <= most;
  }

  const char* at_;
  const char* end_;
  const LinesSoFar& so_far_;
  std::uint64_t points_;
  const char* word_ = nullptr;
  bool damaged_ = false;
};

}  // namespace pointfair::io
