// SPDX-License-Identifier: Apache-2.0
// The layout is that of Leica's description of PTX: for each scan ten lines of header, then columns times rows points.
#include "io/ptx/scans.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/file_bytes.hpp"
#include "io/no_points.hpp"
#include "io/text.hpp"

namespace pointfair::io::ptx {
namespace {

constexpr std::uint64_t kHeaderLines = 10;
constexpr std::size_t kCoordinates = 3;

// Takes the next line that is not blank.
bool next_filled(std::string_view& rest, std::string_view& line) {
  while (next_line(rest, line))
    if (is_row(line, RowRule::filled)) return true;
  return false;
}

// So many numbers, neither more nor fewer.
template <std::size_t kCount>
std::optional<std::array<double, kCount>> numbers(std::string_view line) {
  std::array<double, kCount> result{};
  std::string_view word;
  for (double& value : result) {
    const std::optional<double> number = next_word(line, word) ? to_number(word) : std::nullopt;
    if (!number || !std::isfinite(*number)) return std::nullopt;
    value = *number;
  }
  if (next_word(line, word)) return std::nullopt;
  return result;
}

std::optional<std::uint64_t> single_count(std::string_view line) {
  std::string_view word;
  const std::optional<std::uint64_t> count = next_word(line, word) ? to_count(word) : std::nullopt;
  return next_word(line, word) ? std::nullopt : count;
}

Position cross(const Position& a, const Position& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// The inverse of a matrix of three rows; false if it has none.
bool invert(const std::array<Position, 3>& m, std::array<Position, 3>& inverse) {
  const std::array<Position, 3> columns{cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])};
  const double determinant = m[0][0] * columns[0][0] + m[0][1] * columns[0][1] + m[0][2] * columns[0][2];
  if (!(std::abs(determinant) > 1e-12)) return false;
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column) inverse[row][column] = columns[column][row] / determinant;
  return true;
}

// Reads the ten lines of a header off the front of `rest`; which line is wrong, from 1, or 0.
int read_header(std::string_view& rest, Scan& scan) {
  std::string_view line;
  const auto count = [&](std::uint64_t& to) {
    const std::optional<std::uint64_t> value = next_filled(rest, line) ? single_count(line) : std::nullopt;
    if (value) to = *value;
    return value.has_value();
  };
  if (!count(scan.columns)) return 1;
  if (!count(scan.rows)) return 2;
  for (int at = 3; at <= 6; ++at) {  // the place, and the axes, which the matrix says again
    const auto values = next_filled(rest, line) ? numbers<3>(line) : std::nullopt;
    if (!values) return at;
    if (at == 3) scan.scanner = *values;
  }
  for (int at = 7; at <= 10; ++at) {
    const auto values = next_filled(rest, line) ? numbers<4>(line) : std::nullopt;
    if (!values || (*values)[3] != (at == 10 ? 1 : 0)) return at;
    Position& to = at == 10 ? scan.pose.translation : scan.pose.axes[static_cast<std::size_t>(at - 7)];
    to = {(*values)[0], (*values)[1], (*values)[2]};
  }
  const Pose none;
  scan.pose.is_identity = scan.pose.axes == none.axes && scan.pose.translation == none.translation;
  return invert(scan.pose.axes, scan.pose.inverse) ? 0 : 9;
}

// What stands behind the coordinates, by the number of words in a row.
std::vector<std::string> names_of(std::size_t words) {
  static const std::vector<std::string> kNames = {"intensity", "red", "green", "blue"};
  const std::size_t values = words - std::min(words, kCoordinates);
  if (values == 3) return {kNames.begin() + 1, kNames.end()};
  std::vector<std::string> names(kNames.begin(), kNames.begin() + std::ptrdiff_t(std::min(values, kNames.size())));
  while (names.size() < values) names.push_back("column_" + std::to_string(names.size() + 4));
  return names;
}

// Adds the columns that no scan before has.
void add_columns(const Scan& scan, TextLayout& text) {
  text.columns.resize(std::max(text.columns.size(), kCoordinates + scan.value_names.size()), ColumnKind::other);
  if (text.columns.size() > kMaxTextColumns) return;  // as TextSource tells
  for (const std::string& name : scan.value_names) {
    if (std::ranges::find(text.attributes, name, &TextColumn::name) != text.attributes.end()) continue;
    TextColumn& column = text.attributes.emplace_back(TextColumn{{name, NativeType::float32, 1}});
    column.typed = false;
    column.has_numbers = true;
    column.is_fraction = name == "intensity";
  }
}

// Cuts the points of a scan where all lines of the text, `rows`, are cut.
void add_blocks(const TextRows& rows, std::uint64_t first_row, std::size_t begin, std::uint64_t points,
                Layout& layout) {
  auto& chunks = layout.text.rows.chunks;
  chunks.push_back({begin, layout.text.count, kHeaderLines});
  auto chunk = std::ranges::upper_bound(rows.chunks, first_row, {}, &TextRows::Chunk::first_row);
  for (; chunk != rows.chunks.end() && chunk->first_row < first_row + points; ++chunk)
    chunks.push_back({chunk->begin, layout.text.count + chunk->first_row - first_row});
  layout.scan_of_block.resize(chunks.size(), layout.scans.size());
}

}  // namespace

Position Pose::turned(const std::array<Position, 3>& by, const Position& direction) {
  Position result{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    result[axis] = direction[0] * by[0][axis] + direction[1] * by[1][axis] + direction[2] * by[2][axis];
  return result;
}

Position Pose::to_shared(const Position& own) const {
  const Position at = turned(axes, own);
  return {at[0] + translation[0], at[1] + translation[1], at[2] + translation[2]};
}

Position Pose::to_own(const Position& shared) const {
  return turned(inverse, {shared[0] - translation[0], shared[1] - translation[1], shared[2] - translation[2]});
}

bool looks_like_ptx(std::string_view text) {
  constexpr std::size_t kFront = 4096;
  std::string_view rest = text.substr(0, kFront);
  Scan scan;
  return read_header(rest, scan) == 0;
}

Layout find_scans(std::string_view text, const std::string& name) {
  const TextRows rows = find_rows(text, {RowRule::filled});
  Layout layout;
  layout.text.extendable = false;
  layout.text.advice = "repair the line";  // whose number the header tells
  layout.text.columns = {ColumnKind::x, ColumnKind::y, ColumnKind::z};
  for (std::uint64_t row = 0; row < rows.count();) {
    Scan scan;
    const std::size_t begin = begin_of_row(text, rows, {RowRule::filled}, row);
    std::string_view rest = text.substr(begin);
    const std::string which = "scan " + std::to_string(layout.scans.size() + 1);
    if (const int wrong = read_header(rest, scan))
      fail(name, which + ": line " + std::to_string(wrong) +
                     " of its header is not that of a PTX file, or a scan has more points than it promises; copy the "
                     "file again or correct the header");
    row += kHeaderLines;
    const std::uint64_t left = rows.count() - row;
    if (scan.columns != 0 && scan.rows > left / scan.columns)
      fail(name, which + ": its header promises " + std::to_string(scan.columns) + " x " + std::to_string(scan.rows) +
                     " points, the file ends after " + std::to_string(left) +
                     "; copy the file again or correct the header");
    std::string_view first;
    if (scan.count() != 0 && next_filled(rest, first)) scan.value_names = names_of(words_of(first).size());
    add_columns(scan, layout.text);
    add_blocks(rows, row, layout.scans.empty() ? 0 : begin, scan.count(), layout);
    layout.text.doubles = layout.text.doubles || !scan.pose.is_identity;
    layout.text.count += scan.count();
    row += scan.count();
    layout.scans.push_back(std::move(scan));
  }
  if (layout.text.count == 0) fail_without_points(name);
  layout.text.rows.chunks.push_back({text.size(), layout.text.count});
  return layout;
}

}  // namespace pointfair::io::ptx
