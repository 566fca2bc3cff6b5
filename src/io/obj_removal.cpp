// SPDX-License-Identifier: Apache-2.0
#include "io/obj_removal.hpp"

#include "io/obj_lines.hpp"

namespace pointfair::io {

ObjRemoval::ObjRemoval(std::span<const std::uint8_t> removed, bool own_normals, const RowShape& shape)
    : left_before_{0}, own_normals_(own_normals), shape_(shape) {
  left_before_.reserve(removed.size() + 1);
  for (const std::uint8_t gone : removed) left_before_.push_back(left_before_.back() + (gone == 0));
}

// A walk over lines of the file.
struct ObjRemoval::Lines {
  const ObjRemoval& removal;
  LinesSoFar so_far;
  std::string& to;

  std::uint32_t left_before(std::uint64_t point) const { return removal.left_before_[point]; }

  // The new number of what had `text` as its number, of which there were `before` lines before.
  std::string number(std::int64_t index, std::string_view text, std::uint64_t before) const {
    const std::int64_t now = left_before(static_cast<std::uint64_t>(index));
    if (now == index && !text.starts_with('-')) return std::string(text);  // as it is written
    return std::to_string(text.starts_with('-') ? now - std::int64_t{left_before(before)} : now + 1);
  }

  // `words`: the corners in the line. A list has points that do not depend on each other.
  void append_corners(std::string_view line, std::string_view words, bool is_list) {
    const std::size_t begin = to.size();
    PatchedText patched(line, to);
    std::size_t corners_seen = 0, left = 0;
    Corners corners(words, so_far, removal.left_before_.size() - 1);
    for (Corner corner; corners.next(corner); ++corners_seen) {
      if (!removal.is_removed(static_cast<std::uint64_t>(corner.point))) {
        ++left;
        patched.replace(corner.point_text, number(corner.point, corner.point_text, so_far.points));
        if (!removal.own_normals_ || corner.normal < 0) continue;
        patched.replace(corner.normal_text, number(corner.normal, corner.normal_text, so_far.normals));
      } else if (is_list) {
        patched.replace(corner.point_text, {});
      } else {
        return to.resize(begin);
      }
    }
    if (left == 0 && corners_seen > 0) return to.resize(begin);
    patched.finish();
  }

  // `line` with its end.
  void append(std::string_view line) {
    std::string_view words = line;
    const ObjLine kind = take_key(words);
    const bool has_key = kind == ObjLine::other && words.size() > 1 && is_blank(words[1]);
    const bool is_line = has_key && words[0] == 'l', is_list = has_key && words[0] == 'p';
    if (kind == ObjLine::face || is_line || is_list) {
      append_corners(line, kind == ObjLine::face ? words : words.substr(1), is_list);
    } else if (!(kind == ObjLine::point && removal.is_removed(so_far.points)) &&
               !(kind == ObjLine::normal && removal.own_normals_ && removal.is_removed(so_far.normals))) {
      to += line;
    }
    so_far.take(kind);
  }
};

void ObjRemoval::append(std::string_view text, std::uint64_t points, std::uint64_t normals, std::string& to) const {
  constexpr std::uint64_t kMany = std::uint64_t{1} << 30;  // so that what is counted from the end, and kept, is read
  Lines lines{*this, {points, own_normals_ ? normals : kMany, kMany}, to};
  std::string_view line;
  while (next_row(text, line, shape_)) lines.append({line.data(), static_cast<std::size_t>(text.data() - line.data())});
}

}  // namespace pointfair::io
