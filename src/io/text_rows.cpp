// SPDX-License-Identifier: Apache-2.0
#include "io/text_rows.hpp"

#include <algorithm>
#include <optional>

#include "io/parallel.hpp"

namespace pointfair::io {
namespace {

// What threads hold of their chunks, decoded, is little beside the file.
std::size_t chunk_bytes(std::size_t text) {
  constexpr std::size_t kLeast = std::size_t{1} << 14, kMost = std::size_t{1} << 18, kChunks = 256;
  return std::clamp(text / kChunks, kLeast, kMost);
}

}  // namespace

bool has_further_words(const char* at, const char* end) {
  while (at != end && !is_blank(*at) && *at != ',' && *at != ';') ++at;
  if (at != end && !is_blank(*at)) ++at;
  while (at != end && is_blank(*at)) ++at;
  return at != end;
}

namespace {

// Names of files and remarks may end in a backslash, too.
bool goes_on(std::string_view line) {
  if (!ends_in_backslash(line)) return false;
  const std::size_t first = line.find_first_not_of(" \t");
  return std::string_view("vflp").find(line[first]) != std::string_view::npos;
}

}  // namespace

void take_further_lines(std::string_view& text, std::string_view& line, const RowShape& shape) {
  for (std::string_view more; goes_on(line) && next_line(text, more, shape.line_end);)
    line = {line.data(), static_cast<std::size_t>(more.data() + more.size() - line.data())};
}

bool next_row_of_words(std::string_view& text, std::string_view& line, const RowShape& shape) {
  std::string_view rest = text, word;
  if (!next_word(rest, word)) return false;
  const char* const begin = word.data();
  for (std::size_t w = 1; w < shape.words && next_word(rest, word);) ++w;
  line = {begin, static_cast<std::size_t>(word.data() + word.size() - begin)};
  text = rest;
  return true;
}

namespace {

// Rows that do not end with their lines are found one after the other.
TextRows find_rows_of_words(std::string_view text, const RowShape& shape) {
  constexpr std::uint64_t kRowsOfChunk = 8192;
  TextRows rows;
  std::string_view rest = text, line;
  std::uint64_t found = 0;
  do {
    if (found % kRowsOfChunk == 0) rows.chunks.push_back({text.size() - rest.size(), found});
  } while (next_row(rest, line, shape) && ++found);
  if (rows.chunks.size() > 1 && rows.chunks.back().first_row == found) rows.chunks.pop_back();
  rows.chunks.push_back({text.size(), found});
  return rows;
}

std::size_t end_of_chunk(std::string_view text, std::size_t from, const RowShape& shape) {
  for (;;) {
    const std::size_t end = text.find(shape.line_end, from);
    if (end == std::string_view::npos) return text.size();
    if (shape.rule != RowRule::vertices || !ends_in_backslash(text.substr(0, end))) return end + 1;
    from = end + 1;
  }
}

// The lines of a text whose every line begins with a word; nothing where some do not.
std::optional<std::uint64_t> count_filled_lines(std::string_view text, char line_end) {
  if (text.empty() || static_cast<unsigned char>(text[0]) <= ' ') return std::nullopt;
  std::uint64_t lines = 1;
  constexpr std::size_t kStep = 255;  // counts in bytes, of which a processor adds many at once
  for (std::size_t begin = 0; begin + 1 < text.size(); begin += kStep) {
    const std::size_t end = std::min(begin + kStep, text.size() - 1);
    std::uint8_t ends = 0, blank = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const bool is_end = text[i] == line_end;
      ends = static_cast<std::uint8_t>(ends + is_end);
      blank = static_cast<std::uint8_t>(blank | (is_end & (static_cast<unsigned char>(text[i + 1]) <= ' ')));
    }
    if (blank != 0) return std::nullopt;
    lines += ends;
  }
  return lines;
}

std::uint64_t count_rows(std::string_view text, const RowShape& shape) {
  if (shape.rule == RowRule::filled)
    if (const auto lines = count_filled_lines(text, shape.line_end)) return *lines;
  std::string_view line;
  std::uint64_t found = 0;
  while (next_row(text, line, shape)) found += is_row(line, shape.rule);
  return found;
}

}  // namespace

TextRows find_rows(std::string_view text, const RowShape& shape) {
  if (shape.rule == RowRule::words) return find_rows_of_words(text, shape);
  TextRows rows;
  const std::size_t bytes = chunk_bytes(text.size());
  for (std::size_t at = 0; at < text.size();) {
    rows.chunks.push_back({at, 0});
    at = end_of_chunk(text, std::min(at + bytes, text.size()) - 1, shape);
  }
  const std::size_t count = rows.chunks.size();
  rows.chunks.push_back({text.size(), 0});
  for_each_block(count, [&](std::size_t c) {
    rows.chunks[c + 1].first_row =
        count_rows(text.substr(rows.chunks[c].begin, rows.chunks[c + 1].begin - rows.chunks[c].begin), shape);
  });
  for (std::size_t c = 0; c < count; ++c) rows.chunks[c + 1].first_row += rows.chunks[c].first_row;
  return rows;
}

std::size_t begin_of_row(std::string_view text, const TextRows& rows, const RowShape& shape, std::uint64_t row) {
  if (row >= rows.count()) return text.size();
  const auto behind = std::ranges::upper_bound(rows.chunks, row, {}, &TextRows::Chunk::first_row);
  const TextRows::Chunk& chunk = *(behind - 1);
  std::string_view rest = text.substr(chunk.begin), line;
  std::uint64_t at = chunk.first_row;
  while (next_row(rest, line, shape)) {
    if (is_row(line, shape.rule) && at++ == row) break;
  }
  return static_cast<std::size_t>(line.data() - text.data());
}

}  // namespace pointfair::io
