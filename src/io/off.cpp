// SPDX-License-Identifier: Apache-2.0
// Reading and writing OFF (Geomview's object file format), with the vertex normals of NOFF and the colours of COFF.
#include <algorithm>

#include "io/formats.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

// The lines before the first vertex.
struct OffHeader {
  bool texture = false, colors = false, normals = false;
  std::uint64_t points = 0, faces = 0;
  std::size_t end = 0;  ///< where the first vertex's line may begin
};

std::string_view without_comment(std::string_view line) { return line.substr(0, line.find('#')); }

class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::string& name) : text_(text), rest_(text), name_(name) {}

  OffHeader read() {
    std::vector<std::string_view> words = next_words();
    keyword(words.empty() ? std::string_view() : words[0]);
    words.erase(words.begin());
    if (!words.empty() && words[0] == "BINARY") fail(name_, "binary OFF is not supported; convert it to text");
    if (words.empty()) words = next_words();
    const auto points = words.size() >= 2 ? to_count(words[0]) : std::nullopt;
    const auto faces = words.size() >= 2 ? to_count(words[1]) : std::nullopt;
    if (!points || !faces) fail(name_, "the numbers of points and faces do not follow the first word");
    header_.points = *points;
    header_.faces = *faces;
    header_.end = text_.size() - rest_.size();
    return header_;
  }

 private:
  std::vector<std::string_view> next_words() {
    std::string_view line;
    while (next_line(rest_, line)) {
      if (auto words = words_of(without_comment(line)); !words.empty()) return words;
    }
    return {};
  }

  void keyword(std::string_view word) {
    const auto take = [&](std::string_view prefix) {
      const bool there = word.starts_with(prefix) && word != "OFF";
      if (there) word.remove_prefix(prefix.size());
      return there;
    };
    header_.texture = take("ST");
    header_.colors = take("C");
    header_.normals = take("N");
    if (word == "4OFF" || word == "nOFF" || word == "4nOFF") fail(name_, "only OFF files in 3 dimensions can be read");
    if (word != "OFF") fail(name_, "does not begin with 'OFF'; is it another format?");
  }

  std::string_view text_, rest_;
  const std::string& name_;
  OffHeader header_;
};

class OffSource : public TextSource {
 public:
  OffSource(OffHeader header, FileBytes bytes, const std::string& name, TextLayout layout)
      : TextSource(std::move(bytes), name, Format::off, std::move(layout)), header_(header) {}

  Faces faces() const override {
    Faces faces;
    std::string_view rest = bytes().substr(row_begin(header_.points)), line;
    while (faces.ends.size() < header_.faces && next_line(rest, line)) {
      if (is_row(line, layout().rule)) add_face(without_comment(line), faces);
    }
    return faces;
  }

 protected:
  std::string header(const AddedAttributes&) const override { return std::string(bytes().substr(0, layout().begin)); }

 private:
  void add_face(std::string_view line, Faces& faces) const {
    std::string_view word;
    const auto corners = next_word(line, word) ? to_count(word) : std::nullopt;
    bool sound = corners.has_value();
    for (std::uint64_t c = 0; sound && c < *corners; ++c) {
      const auto corner = next_word(line, word) ? to_count(word) : std::nullopt;
      sound = corner && *corner < header_.points;
      if (sound) faces.corners.push_back(static_cast<std::uint32_t>(*corner));
    }
    if (!sound) {
      fail(name(), "line " + std::to_string(line_number(bytes(), line.data())) +
                       ": a face needs a count and so many points of the file; repair the line");
    }
    faces.ends.push_back(faces.corners.size());
  }

  OffHeader header_;
};

TextLayout make_layout(const OffHeader& header, std::string_view text) {
  TextLayout layout;
  layout.begin = header.end;
  layout.rule = RowRule::uncommented;
  layout.rows = find_rows(text.substr(header.end), layout.rule);
  layout.count = header.points;
  layout.extendable = false;
  layout.columns = {ColumnKind::x, ColumnKind::y, ColumnKind::z};

  std::vector<std::string> names;
  if (header.normals) names = {"nx", "ny", "nz"};
  if (header.colors) names.insert(names.end(), {"red", "green", "blue", "alpha"});
  const std::string_view first =
      text.substr(header.end + begin_of_row(text.substr(header.end), layout.rows, layout.rule, 0));
  const std::size_t words = words_of(without_comment(first.substr(0, first.find('\n')))).size();
  const std::size_t texture = header.texture ? 2 : 0;
  for (std::size_t i = 0; i < names.size() && 3 + i + texture < words; ++i) {
    layout.attributes.push_back({{names[i], NativeType::float64, 1}, 3 + i, false});
  }
  return layout;
}

std::vector<const TableColumn*> normal_columns(const Table& table) {
  std::vector<const TableColumn*> columns = {table.find("nx"), table.find("ny"), table.find("nz")};
  if (std::find(columns.begin(), columns.end(), nullptr) != columns.end()) columns.clear();
  return columns;
}

}  // namespace

std::shared_ptr<Source> read_off(FileBytes bytes, const std::string& name) {
  const OffHeader header = HeaderReader(bytes.view(), name).read();
  if (header.points == 0) fail(name, "has no points; choose another file");
  TextLayout layout = make_layout(header, bytes.view());
  const std::uint64_t rows = layout.rows.count();
  const std::string promised = "header promises " + std::to_string(header.points) + " points";
  if (rows < header.points) {
    fail(name, promised + ", file ends after " + std::to_string(rows) + "; copy the file again or correct the header");
  }
  if (rows - header.points != header.faces) {
    fail(name, promised + " and " + std::to_string(header.faces) + " faces, file holds " +
                   std::to_string(rows - header.points) + " lines of faces; correct the header");
  }
  return std::make_shared<OffSource>(header, std::move(bytes), name, std::move(layout));
}

void write_off(Table table, Output& out) {
  use_ply_names(table);
  std::vector<std::array<std::uint8_t, 3>> colors;
  const bool colored = colors_as_bytes(table, colors);
  const auto normals = normal_columns(table);
  out.write(std::string(colored ? "C" : "") + (normals.empty() ? "OFF\n" : "NOFF\n") + std::to_string(table.size()) +
            " " + std::to_string(table.faces.ends.size()) + " 0\n");
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    for (const double value : table.positions[i]) {
      append_as(buffer, value, native(table.coordinate_type));
      buffer += ' ';
    }
    for (const TableColumn* column : normals) {
      append_scalar(buffer, column->data.data() + i * column_bytes(*column), column->type);
      buffer += ' ';
    }
    if (colored) {
      for (const std::uint8_t channel : colors[i]) buffer += std::to_string(channel) + ' ';
      buffer += "255 ";
    }
    buffer.back() = '\n';
  });
  write_rows(out, table.faces.ends.size(), [&](std::size_t face, std::string& buffer) {
    const std::uint64_t begin = face == 0 ? 0 : table.faces.ends[face - 1], end = table.faces.ends[face];
    buffer += std::to_string(end - begin);
    for (std::uint64_t c = begin; c < end; ++c) buffer += ' ' + std::to_string(table.faces.corners[c]);
    buffer += '\n';
  });
}

}  // namespace pointfair::io
