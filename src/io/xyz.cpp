// SPDX-License-Identifier: Apache-2.0
// Reading and writing columns of numbers: XYZ, TXT, CSV, PTS.
#include <algorithm>
#include <functional>

#include "io/column_names.hpp"
#include "io/formats.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

using Words = std::vector<std::string_view>;

// What precedes the first point.
struct Front {
  std::size_t end = 0;             ///< where the first point's line begins
  std::vector<std::string> names;  ///< of the columns, if a line tells them
  std::size_t names_end = 0;       ///< where that line takes further names; 0: there is none
  char names_separator = ' ';
  std::optional<std::uint64_t> count;  ///< of a PTS file
};

std::string_view unquoted(std::string_view word) {
  return word.size() > 1 && word.front() == '"' && word.back() == '"' ? word.substr(1, word.size() - 2) : word;
}

bool is_header(const Words& words) {
  return !std::all_of(words.begin(),
                      words.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(3, words.size())),
                      [](std::string_view word) { return to_number(word).has_value(); });
}

std::optional<std::size_t> find_name(const std::vector<std::string>& names, std::string_view wanted) {
  const auto found = std::find_if(names.begin(), names.end(), [&](const auto& n) { return lower_case(n) == wanted; });
  if (found == names.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names.begin());
}

class FrontReader {
 public:
  FrontReader(std::string_view text, Format format) : text_(text), rest_(text), format_(format) {
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
    if (rest_.starts_with(kByteOrderMark)) rest_.remove_prefix(kByteOrderMark.size());
  }

  Front read() {
    std::string_view line, comment;
    bool header_seen = false;
    for (;;) {
      front_.end = text_.size() - rest_.size();
      if (!next_line(rest_, line)) return front_;
      if (!is_row(line, RowRule::uncommented)) {
        if (line.size() > 1) comment = line;
        continue;
      }
      const Words words = words_of(line, separator_of(line));
      if (format_ == Format::pts && !front_.count && words.size() == 1 && to_count(words[0])) {
        front_.count = to_count(words[0]);
      } else if (!header_seen && is_header(words)) {
        header_seen = true;
        take_names(line, words);
      } else {
        if (!header_seen) take_comment(comment, words.size());
        return front_;
      }
    }
  }

 private:
  void take_names(std::string_view line, const Words& words) {
    for (const std::string_view word : words) front_.names.emplace_back(unquoted(word));
    std::size_t size = line.size();
    while (size > 0 && is_blank(line[size - 1])) --size;
    front_.names_end = static_cast<std::size_t>(line.data() + size - text_.data());
    front_.names_separator = separator_of(line);
  }

  // CloudCompare writes the names as a comment: "//X Y Z R G B".
  void take_comment(std::string_view comment, std::size_t columns) {
    const std::size_t begin = comment.find_first_not_of("#/ \t");
    if (begin == std::string_view::npos) return;
    comment.remove_prefix(begin);
    const Words words = words_of(comment, separator_of(comment));
    const std::vector<std::string> names(words.begin(), words.end());
    if (words.size() != columns || !find_name(names, "x") || !find_name(names, "y") || !find_name(names, "z")) return;
    take_names(comment, words);
  }

  std::string_view text_, rest_;
  Format format_;
  Front front_;
};

class XyzSource : public TextSource {
 public:
  XyzSource(Front front, FileBytes bytes, const std::string& name, Format format, TextLayout layout)
      : TextSource(std::move(bytes), name, format, std::move(layout)), front_(std::move(front)) {}

 protected:
  std::string header(const AddedAttributes& added) const override {
    std::string text(bytes().substr(0, front_.end));
    if (front_.names_end == 0) return text;
    std::string names;
    for (const Attribute* attribute : added) {
      for (const std::string& name : component_names(attribute->name, attribute->components)) {
        names += front_.names_separator + one_word(name);
      }
    }
    return text.insert(front_.names_end, names);
  }

 private:
  Front front_;
};

// What the columns behind the coordinates are called where no line tells.
std::vector<std::string> usual_names(Format format, std::size_t columns) {
  std::vector<std::string> names = {"x", "y", "z"};
  if (format == Format::pts && (columns == 4 || columns == 7)) names.emplace_back("intensity");
  if (format == Format::pts && columns >= 6 && columns <= 7) names.insert(names.end(), {"red", "green", "blue"});
  while (names.size() < columns) names.push_back("column_" + std::to_string(names.size() + 1));
  return names;
}

TextLayout make_layout(const Front& front, std::string_view first, Format format, const std::string& name) {
  TextLayout layout;
  layout.separator = separator_of(first);
  const std::size_t columns = words_of(first, layout.separator).size();
  layout.begin = front.end;
  layout.rule = RowRule::uncommented;
  layout.columns.assign(std::max<std::size_t>(columns, 3), ColumnKind::other);
  const auto names = front.names.empty() ? usual_names(format, columns) : front.names;
  layout.columns.resize(std::max(layout.columns.size(), names.size()), ColumnKind::other);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string wanted(1, static_cast<char>('x' + axis));
    const auto column = find_name(names, wanted);
    if (!column) fail(name, "no column is called '" + wanted + "'; name the coordinates x, y, z in the first line");
    layout.columns[*column] = static_cast<ColumnKind>(axis);
  }
  for (std::size_t c = 0; c < names.size(); ++c) {
    if (layout.columns[c] == ColumnKind::other)
      layout.attributes.push_back({{names[c], NativeType::float64, 1}, c, false});
  }
  return layout;
}

}  // namespace

std::shared_ptr<Source> read_xyz(FileBytes bytes, const std::string& name, Format format) {
  const std::string_view text = bytes.view();
  Front front = FrontReader(text, format).read();
  if (front.end == text.size()) fail(name, "has no points; choose another file");
  const std::string_view first = text.substr(front.end, text.find('\n', front.end) - front.end);
  TextLayout layout = make_layout(front, first, format, name);
  layout.rows = find_rows(text.substr(front.end), layout.rule);
  layout.count = layout.rows.count();
  if (front.count && *front.count != layout.count) {
    fail(name, "first line promises " + std::to_string(*front.count) + " points, file holds " +
                   std::to_string(layout.count) + "; copy the file again or correct the first line");
  }
  return std::make_shared<XyzSource>(std::move(front), std::move(bytes), name, format, std::move(layout));
}

void write_xyz(Table table, Format format, Output& out) {
  use_ply_names(table);
  const char separator = format == Format::csv ? ',' : ' ';
  if (format == Format::pts) out.write(std::to_string(table.size()) + "\n");
  if (format == Format::csv || (format == Format::txt && !table.columns.empty())) {
    std::string names = std::string("x") + separator + "y" + separator + "z";
    for (const TableColumn& column : table.columns) names += separator + one_word(column.name);
    out.write(names + "\n");
  }
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    for (const double value : table.positions[i]) {
      append_as(buffer, value, native(table.coordinate_type));
      buffer += separator;
    }
    for (const TableColumn& column : table.columns) {
      append_scalar(buffer, column.data.data() + i * column_bytes(column), column.type);
      buffer += separator;
    }
    buffer.back() = '\n';
  });
}

}  // namespace pointfair::io
