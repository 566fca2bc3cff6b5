// SPDX-License-Identifier: Apache-2.0
#include "io/detect.hpp"

#include <algorithm>
#include <array>

#include "io/ptx/scans.hpp"
#include "io/stl/facets.hpp"
#include "io/text.hpp"
#include "io/text_source.hpp"

namespace pointfair {
namespace io {
namespace {

// The first line that is neither blank nor a comment, looked for near the front only.
std::string_view first_line(std::string_view bytes) {
  constexpr std::size_t kFront = 65536;
  std::string_view rest = bytes.substr(byte_order_mark(bytes), kFront), line;
  const char line_end = line_end_of(rest);
  while (next_line(rest, line, line_end)) {
    if (is_row(line, RowRule::uncommented)) return line;
  }
  return {};
}

// "solid" and a name, then the first facet, or the end of an empty one.
bool is_text_stl(std::string_view bytes) {
  std::string_view rest = bytes.substr(0, 4096), line, word;
  if (!next_line(rest, line) || !next_word(line, word) || lower_case(word) != "solid") return false;
  while (next_line(rest, line)) {
    if (next_word(line, word)) return lower_case(word) == "facet" || lower_case(word) == "endsolid";
  }
  return false;
}

// The counts may follow without a blank, "OFF600 2 0".
bool is_off_keyword(std::string_view word) {
  while (!word.empty() && word.back() >= '0' && word.back() <= '9') word.remove_suffix(1);
  if (lower_case(word) == "off") return true;
  if (!word.ends_with("OFF")) return false;
  word.remove_suffix(3);
  for (const std::string_view prefix : {"ST", "C", "N", "4", "n"})
    if (word.starts_with(prefix)) word.remove_prefix(prefix.size());
  return word.empty();
}

}  // namespace

std::optional<Format> format_of_content(std::string_view bytes) {
  bytes.remove_prefix(byte_order_mark(bytes));
  if (bytes.starts_with("ply\n") || bytes.starts_with("ply\r") || bytes.starts_with("ply ")) return Format::ply;
  if (bytes.starts_with("# .PCD")) return Format::pcd;
  if (bytes.starts_with("LASF")) return bytes.size() > 104 && (bytes[104] & 0x80) != 0 ? Format::laz : Format::las;
  if (bytes.starts_with("ASTM-E57")) return Format::e57;
  if (bytes.starts_with("\x93NUMPY")) return Format::npy;
  if (bytes.starts_with("glTF")) return Format::glb;
  if (stl::is_binary(bytes) || is_text_stl(bytes)) return Format::stl;
  if (ptx::looks_like_ptx(bytes)) return Format::ptx;
  std::string_view line = first_line(bytes), word;
  if (!next_word(line, word)) return std::nullopt;
  if (is_off_keyword(word)) return Format::off;
  if (word == "VERSION" || word == "FIELDS" || word == "COLUMNS") return Format::pcd;
  static constexpr std::array<std::string_view, 9> kObjKeywords = {"v", "vn", "vt", "f", "o", "g", "s", "l", "mtllib"};
  const bool obj = std::ranges::find(kObjKeywords, word) != kObjKeywords.end();
  // A line of column names may begin with such a letter, too.
  if (obj && (word != "v" || (next_word(line, word) && to_number(word)))) return Format::obj;
  return std::nullopt;
}

bool looks_like_numbers(std::string_view bytes) {
  std::string_view line = first_line(bytes), word;
  return next_word(line, word, separator_of(line)) && to_number(word).has_value();
}

}  // namespace io

}  // namespace pointfair
