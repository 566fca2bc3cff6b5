// SPDX-License-Identifier: Apache-2.0
// Reading and writing columns of numbers: XYZ, TXT, CSV, PTS.
#include <algorithm>

#include "io/colors.hpp"
#include "io/column_names.hpp"
#include "io/formats.hpp"
#include "io/text_source.hpp"
#include "io/xyz_front.hpp"

namespace pointfair::io {
namespace {

class XyzSource : public TextSource {
 public:
  XyzSource(XyzFront front, FileBytes bytes, const std::string& name, Format format, TextLayout layout)
      : TextSource(std::move(bytes), name, format, std::move(layout)), front_(std::move(front)) {}

  // Counts of rows would have to follow.
  bool leaves_points_out() const override { return !front_.count; }

  std::vector<Content> contents() const override {
    std::vector<Content> result = TextSource::contents();
    if (front_.has_titles) result.push_back({ContentKind::comments, "the lines before the first row"});
    if (const std::uint64_t scans = count_scans(); scans > 1)
      result.push_back({ContentKind::groups, "the borders of " + counted(scans, "scan")});
    return result;
  }

  std::vector<std::string> names_by_place() const override {
    if (!front_.is_by_place) return {};
    return {front_.names.begin() + 3, front_.names.begin() + std::ptrdiff_t(front_.named)};
  }

 protected:
  std::string header(const Edits& edits) const override {
    std::string text(bytes().substr(0, front_.end));
    if (front_.names_end == 0 || edits.added.empty()) return text;
    if (front_.is_doubtful)
      fail(name(),
           "between its names and its first row are lines that are neither, or its rows have more values than "
           "names, so no column is added; repair it, or choose PLY");
    std::string names;
    for (std::size_t c = front_.named; c < front_.names.size(); ++c)
      names += front_.names_separator + one_word(front_.names[c]);
    for (const Attribute* attribute : edits.added) {
      for (const std::string& name : component_names(attribute->name, attribute->components))
        names += front_.names_separator + one_word(name);
    }
    return text.insert(front_.names_end, names);
  }

 private:
  // Each stands behind a line with its count.
  std::uint64_t count_scans() const {
    std::uint64_t scans = 1;
    std::string_view rows = bytes().substr(layout().begin), line;
    while (front_.count && next_line(rows, line, front_.line_end))
      scans += is_row(line, RowRule::uncommented) && !is_row(line, RowRule::counted);
    return scans;
  }

  XyzFront front_;
};

TextLayout make_layout(const XyzFront& front, std::string_view text) {
  TextLayout layout;
  layout.begin = front.end;
  // Editors and full disks leave zeros or the end sign of DOS behind the last line.
  layout.end = text.find_last_not_of(std::string_view("\0\x1A", 2)) + 1;
  layout.separator = front.separator;
  layout.decimal = front.decimal;
  layout.shape = {front.count ? RowRule::counted : RowRule::uncommented, front.line_end, 0};
  layout.columns.assign(std::max<std::size_t>(front.names.size(), 3), ColumnKind::other);
  for (std::size_t axis = 0; axis < 3; ++axis) layout.columns[front.coordinates[axis]] = static_cast<ColumnKind>(axis);
  for (std::size_t c = 0; c < front.names.size(); ++c) {
    if (layout.columns[c] == ColumnKind::other)
      layout.attributes.push_back({{front.names[c], NativeType::float64, 1}, c, false});
  }
  layout.rows = find_rows(text.substr(layout.begin, layout.end - layout.begin), layout.shape);
  layout.count = layout.rows.count();
  return layout;
}

// Several scans may follow each other, each behind a line with its count.
std::uint64_t promised_rows(const XyzFront& front, const TextLayout& layout, std::string_view text) {
  std::string_view rows = text.substr(layout.begin, layout.end - layout.begin), line;
  std::uint64_t promised = *front.count;
  while (next_line(rows, line, front.line_end)) {
    if (!is_row(line, RowRule::uncommented) || is_row(line, RowRule::counted)) continue;
    promised += to_count(words_of(line)[0]).value_or(0);
  }
  return promised;
}

void check_count(const XyzFront& front, const TextLayout& layout, std::string_view text, const std::string& name) {
  const std::string_view rows = text.substr(0, layout.end);
  const std::size_t last_end = rows.find_last_not_of(" \t\r\n");
  const std::size_t before = rows.find_last_of("\r\n", last_end);
  const bool ends_with_row = is_row(rows.substr(before + 1, last_end - before), RowRule::counted);
  if (ends_with_row && *front.count == layout.count) return;
  const std::uint64_t promised = promised_rows(front, layout, text);
  if (ends_with_row && promised == layout.count) return;
  fail(name, (promised == *front.count ? "first line promises " : "lines of one number promise ") +
                 std::to_string(promised) + " points, file holds " + std::to_string(layout.count) +
                 "; copy the file again or correct the first line");
}

// PTS has no names: by their places, readers take an intensity, then colours.
void order_as_pts(Table& table) {
  constexpr std::size_t kOneAndColors = 4;
  const bool one_beside_colors = !table.find_all(kChannels).empty() && table.columns.size() == kOneAndColors;
  const auto place = [&](const TableColumn& column) {
    if (column.name == "red") return 1;
    if (column.name == "green") return 2;
    if (column.name == "blue") return 3;
    return lower_case(column.name) == "intensity" || one_beside_colors ? 0 : 4;
  };
  std::ranges::stable_sort(table.columns,
                           [&](const TableColumn& a, const TableColumn& b) { return place(a) < place(b); });
}

}  // namespace

std::shared_ptr<Source> read_xyz(FileBytes bytes, const std::string& name, const Reading& reading) {
  const std::string_view text = bytes.view();
  XyzFront front = read_xyz_front(text, name, reading.options, reading.format);
  TextLayout layout = make_layout(front, text);
  if (front.count) check_count(front, layout, text, name);
  return std::make_shared<XyzSource>(std::move(front), std::move(bytes), name, reading.format, std::move(layout));
}

void write_xyz(Table table, const Writing& writing, Output& out) {
  const Format format = writing.format;
  use_ply_names(table, format == Format::csv || format == Format::txt ? ColorDepth::any : ColorDepth::bytes);
  use_words_as_names(table);
  const char separator = format == Format::csv ? ',' : ' ';
  if (format == Format::pts) order_as_pts(table);
  if (format == Format::pts) out.write(std::to_string(table.size()) + "\n");
  if (format == Format::csv || (format == Format::txt && !table.columns.empty())) {
    std::string names = std::string("x") + separator + "y" + separator + "z";
    for (const TableColumn& column : table.columns) names += separator + column.name;
    out.write(names + "\n");
  }
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    append_position(buffer, table, i, separator);
    for (const TableColumn& column : table.columns) append_value(buffer, column, i, separator);
    buffer.back() = '\n';
  });
}

}  // namespace pointfair::io
