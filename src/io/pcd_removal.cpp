// SPDX-License-Identifier: Apache-2.0
#include "io/pcd_removal.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <vector>

#include "io/text.hpp"
#include "io/text_rows.hpp"

namespace pointfair::io {

std::uint64_t count_left(std::span<const std::uint8_t> removed) {
  return static_cast<std::uint64_t>(std::ranges::count(removed, 0));
}

void take_out_records(std::span<const std::uint8_t> removed, std::size_t size, std::size_t begin, std::string& data) {
  char* to = data.data() + begin;
  const char* from = to;
  for (const std::uint8_t is_removed : removed) {
    if (is_removed == 0) {
      std::memmove(to, from, size);
      to += size;
    }
    from += size;
  }
  data.resize(static_cast<std::size_t>(to - data.data()));
}

void take_out_lines(std::span<const std::uint8_t> removed, char line_end, std::size_t begin, std::string& text) {
  const std::string all = text.substr(begin);
  text.resize(begin);
  std::string_view rest = all, line;
  for (std::size_t row = 0; !rest.empty();) {
    const char* const from = rest.data();
    next_line(rest, line, line_end);
    if (is_row(line, RowRule::uncommented) && removed[row++] != 0) continue;
    text.append(from, rest.data());
  }
}

std::string pcd_header_of(std::string header, char line_end, std::uint64_t points) {
  std::string result;
  std::string_view rest = header, line;
  while (!rest.empty()) {
    const char* const from = rest.data();
    next_line(rest, line, line_end);
    const std::vector<std::string_view> words = words_of(line);
    const bool counts = !words.empty() && (words[0] == "WIDTH" || words[0] == "POINTS");
    if (words.size() < 2 || (!counts && words[0] != "HEIGHT")) {
      result.append(from, rest.data());
      continue;
    }
    result.append(from, words[1].data());
    result += counts ? std::to_string(points) : "1";
    result.append(words[1].data() + words[1].size(), rest.data());
  }
  return result;
}

}  // namespace pointfair::io
