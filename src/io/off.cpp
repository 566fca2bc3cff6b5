// SPDX-License-Identifier: Apache-2.0
// Reading and writing OFF (Geomview's object file format), with the vertex normals of NOFF and the colours of COFF.
#include <algorithm>

#include "io/colors.hpp"
#include "io/formats.hpp"
#include "io/no_points.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

std::string_view without_remark(std::string_view line) { return line.substr(0, line.find('#')); }

// What comes before the first vertex.
struct OffHeader {
  bool texture = false, colors = false, normals = false;
  std::uint64_t points = 0, faces = 0;
  std::size_t end = 0;  ///< where the first vertex may begin
  char line_end = '\n';
  bool faces_have_lines = false;  ///< of their own
};

// The words of a file one after the other, whatever lines they stand on; remarks are passed over.
class OffWords {
 public:
  OffWords(std::string_view text, char line_end) : text_(text), rest_(text), line_end_(line_end) {}

  /// The next word, empty at the end of the file.
  std::string_view next() {
    std::string_view word;
    while (next_word(rest_, word)) {
      const std::size_t remark = word.find('#');
      if (remark == std::string_view::npos) return word;
      skip_line(word.data() + remark);
      if (remark > 0) return word.substr(0, remark);
    }
    return {};
  }
  /// Passes over the rest of the line on which the last word stands.
  void skip_line() { skip_line(rest_.data()); }
  std::size_t position() const { return text_.size() - rest_.size(); }

 private:
  void skip_line(const char* from) {
    const std::size_t at = static_cast<std::size_t>(from - text_.data());
    rest_ = text_.substr(std::min(text_.find(line_end_, at), text_.size()));
  }

  std::string_view text_, rest_;
  char line_end_;
};

class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::string& name)
      : text_(text), mark_(byte_order_mark(text)), words_(text.substr(mark_), line_end_of(text)), name_(name) {}

  OffHeader read() {
    header_.line_end = line_end_of(text_);
    std::string_view word = words_.next();
    if (!to_count(word)) {  // the keyword may be left out, and the counts may follow it without a blank
      const std::size_t end = word.find_last_not_of("0123456789") + 1;
      keyword(word.substr(0, end));
      word = end < word.size() ? word.substr(end) : words_.next();
    }
    if (word == "BINARY") fail(name_, "binary OFF is not supported; convert it to text");
    const auto points = to_count(word), faces = to_count(words_.next());
    if (!points || !faces) fail(name_, "the numbers of points and faces do not follow the first word");
    take_edges();
    header_.points = *points;
    header_.faces = *faces;
    header_.end = mark_ + words_.position();
    return header_;
  }

 private:
  // The number of edges follows, unless the line of the others ends, and the next one has more than one word.
  void take_edges() {
    std::string_view rest = text_.substr(mark_ + words_.position()), line;
    next_line(rest, line, header_.line_end);
    std::size_t words = words_of(without_remark(line)).size();
    const bool ends = words == 0;
    while (words == 0 && next_line(rest, line, header_.line_end)) words = words_of(without_remark(line)).size();
    if (ends && words > 1) return;
    words_.next();
    line = text_.substr(mark_ + words_.position());
    line = line.substr(0, line.find(header_.line_end));
    if (words_of(without_remark(line)).empty()) words_.skip_line();
  }

  void keyword(std::string_view written) {
    const bool is_small = lower_case(written) == written;  // "nOFF" is not "NOFF"
    const std::string capitals = is_small ? upper_case(written) : std::string(written);
    std::string_view word = capitals;
    const auto take = [&](std::string_view prefix) {
      const bool there = word.starts_with(prefix) && lower_case(word) != "off";
      if (there) word.remove_prefix(prefix.size());
      return there;
    };
    header_.texture = take("ST");
    header_.colors = take("C");
    header_.normals = take("N");
    if (word == "4OFF" || word == "nOFF" || word == "4nOFF") fail(name_, "only OFF files in 3 dimensions can be read");
    if (lower_case(word) != "off") fail(name_, "does not begin with 'OFF'; is it another format?");
  }

  std::string_view text_;
  std::size_t mark_;
  OffWords words_;
  const std::string& name_;
  OffHeader header_;
};

class OffSource : public TextSource {
 public:
  OffSource(OffHeader header, FileBytes bytes, const std::string& name, TextLayout layout)
      : TextSource(std::move(bytes), name, Format::off, std::move(layout)), header_(header) {}

  void visit_faces(FaceVisitor& visitor) const override { read_faces(visitor); }
  bool ends_with_faces() const {
    FaceCounter counter;
    return read_faces(counter).ends;
  }

  std::vector<Content> contents() const override {
    std::vector<Content> result = TextSource::contents();
    if (bytes().substr(0, layout().begin).find('#') != std::string_view::npos)
      result.push_back({ContentKind::comments, "what is commented before the first point"});
    FaceCounter counter;
    if (read_faces(counter).has_values) result.push_back({ContentKind::face_values, "the colours of faces"});
    return result;
  }

 private:
  struct BehindCorners {
    bool has_values = false;  // in the lines of faces
    bool ends = false;        // and nothing follows the faces
  };

  // Colours may follow the corners up to the end of the line, unless several faces share one.
  BehindCorners read_faces(FaceVisitor& visitor) const {
    constexpr std::size_t kPassed = std::size_t{1} << 20;  // bytes at a time
    const std::string_view text = bytes().substr(std::min(layout().end, row_begin(header_.points)));
    OffWords words(text, header_.line_end);
    BehindCorners result;
    constexpr std::size_t kLeastFace = 2, kLeastCorner = 2;  // in bytes: "0\n", "0 "
    const std::uint64_t faces = std::min<std::uint64_t>(header_.faces, text.size() / kLeastFace);
    visitor.expect({faces, (text.size() - kLeastFace * faces) / kLeastCorner, false});
    std::vector<std::uint32_t> corners;
    std::size_t passed = 0;
    for (std::uint64_t face = 0; face < header_.faces; ++face) {
      read_face(words, corners);
      visitor.take(corners, {});
      if (header_.faces_have_lines) {
        const std::string_view line = text.substr(words.position());
        const std::size_t more = line.find_first_not_of(" \t");
        result.has_values =
            result.has_values || (more < line.size() && line[more] != '\r' && line[more] != '\n' && line[more] != '#');
        words.skip_line();
      }
      if (words.position() - passed >= kPassed) {
        release(text.substr(passed, words.position() - passed));
        passed = words.position();
      }
    }
    result.ends = words.next().empty();
    return result;
  }

  void read_face(OffWords& words, std::vector<std::uint32_t>& corners) const {
    corners.clear();
    const std::string_view first = words.next();
    const auto count = to_count(first);
    bool sound = count.has_value();
    for (std::uint64_t c = 0; sound && c < *count; ++c) {
      const auto corner = to_count(words.next());
      sound = corner && *corner < header_.points;
      if (sound) corners.push_back(static_cast<std::uint32_t>(*corner));
    }
    if (!sound) {
      const char* const at = first.empty() ? bytes().data() + bytes().size() : first.data();
      fail_at(at, "a face needs a count and so many points of the file; repair the line");
    }
  }

  OffHeader header_;
};

// The columns behind the coordinates: normals, colours, texture coordinates. Many write colours without saying so.
std::vector<std::string> names_of_columns(const OffHeader& header, std::size_t words) {
  std::vector<std::string> names;
  if (header.normals) names = {"nx", "ny", "nz"};
  const std::size_t behind = 3 + names.size() + (header.texture ? 2 : 0);
  std::size_t others = words > behind ? words - behind : 0;
  if (header.colors || others == 3 || others == 4) {
    for (const char* channel : {"red", "green", "blue", "alpha"}) {
      if (others == 0) break;
      names.emplace_back(channel);
      --others;
    }
  }
  if (header.texture) names.insert(names.end(), {"s", "t"});
  for (; others > 0; --others) names.push_back("column_" + std::to_string(names.size() + 4));
  return names;
}

// Whether each vertex has a line of its own, to judge by the first ones.
bool has_lines_of_vertices(const OffHeader& header, const TextLayout& layout, std::string_view text) {
  constexpr int kLooked = 100;
  if (layout.rows.count() < header.points) return false;
  std::string_view rest = text, line;
  std::uint64_t row = 0;
  while (row < std::min<std::uint64_t>(kLooked, header.points) && next_row(rest, line, layout.shape)) {
    if (!is_row(line, layout.shape.rule)) continue;
    if (words_of(without_remark(line)).size() < 3) return false;
    ++row;
  }
  return true;
}

std::string_view first_row(std::string_view text, const TextLayout& layout) {
  std::string_view rest = text.substr(begin_of_row(text, layout.rows, layout.shape, 0)), line;
  next_row(rest, line, layout.shape);
  return without_remark(line);
}

std::uint64_t count_words(std::string_view text) {
  std::uint64_t count = 0;
  for (std::string_view word; next_word(text, word);) ++count;
  return count;
}

// Vertices that do not keep to lines.
void use_words(const OffHeader& header, std::string_view text, const std::string& name, TextLayout& layout) {
  if (header.colors)
    fail(name, "its vertices do not stand on lines of their own, so their colours cannot be told apart");
  layout.shape = {RowRule::words, header.line_end, 3U + (header.normals ? 3U : 0U) + (header.texture ? 2U : 0U)};
  const std::uint64_t words = count_words(text), points = words / layout.shape.words;
  if (points < header.points)
    fail(name, "header promises " + std::to_string(header.points) + " points, file ends after " +
                   std::to_string(points) + "; copy the file again or correct the header");
  if (text.find('#') != std::string_view::npos)
    fail(name, "has remarks among vertices that do not stand on lines of their own; remove them");
  layout.rows = find_rows(text, layout.shape);
}

TextLayout make_layout(OffHeader& header, std::string_view text, const std::string& name) {
  TextLayout layout;
  layout.begin = header.end;
  layout.shape = {RowRule::uncommented, header.line_end, 0};
  layout.count = header.points;
  layout.extendable = false;
  layout.columns = {ColumnKind::x, ColumnKind::y, ColumnKind::z};
  const std::string_view body = text.substr(header.end);
  layout.rows = find_rows(body, layout.shape);
  const bool lines = has_lines_of_vertices(header, layout, body);
  std::size_t words = lines ? words_of(first_row(body, layout)).size() : 0;
  header.faces_have_lines = lines && layout.rows.count() - header.points == header.faces;
  if (lines && words < 6 && layout.rows.count() == header.points && header.faces > 0)
    fail(name, "header promises " + std::to_string(header.points) + " points and " + std::to_string(header.faces) +
                   " faces, file holds 0 lines of faces; correct the header");
  if (!header.faces_have_lines && (!lines || words >= 6)) {
    use_words(header, body, name, layout);
    words = layout.shape.words;
  }
  const std::vector<std::string> names = names_of_columns(header, words);
  for (std::size_t i = 0; i < names.size() && 3 + i < words; ++i)
    layout.attributes.push_back({{names[i], NativeType::float64, 1}, 3 + i, false});
  return layout;
}

}  // namespace

std::shared_ptr<Source> read_off(FileBytes bytes, const std::string& name, const Reading&) {
  OffHeader header = HeaderReader(bytes.view(), name).read();
  if (header.points == 0) fail_without_points(name);
  TextLayout layout = make_layout(header, bytes.view(), name);
  const auto source = std::make_shared<OffSource>(header, std::move(bytes), name, std::move(layout));
  if (!header.faces_have_lines && !source->ends_with_faces())
    fail(name, "header promises " + std::to_string(header.points) + " points and " + std::to_string(header.faces) +
                   " faces, file holds more lines; correct the header");
  return source;
}

void write_off(Table table, const Writing&, Output& out) {
  use_ply_names(table);
  const auto colors = table.find_all(kChannels), normals = table.find_all(kNormals);
  out.write(std::string(colors.empty() ? "" : "C") + (normals.empty() ? "OFF\n" : "NOFF\n") +
            std::to_string(table.size()) + " " + std::to_string(table.faces.ends.size()) + " 0\n");
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    append_position(buffer, table, i, ' ');
    for (const TableColumn* column : normals) append_value(buffer, *column, i, ' ');
    for (const TableColumn* column : colors) append_value(buffer, *column, i, ' ');
    if (!colors.empty()) buffer += "255 ";
    buffer.back() = '\n';
  });
  write_rows(out, table.faces.ends.size(), [&](std::size_t face, std::string& buffer) {
    buffer += std::to_string(table.faces.corners_of(face).size());
    for (const std::uint32_t corner : table.faces.corners_of(face)) buffer += ' ' + std::to_string(corner);
    buffer += '\n';
  });
}

}  // namespace pointfair::io
