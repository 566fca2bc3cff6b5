// SPDX-License-Identifier: Apache-2.0
// Reading and writing Wavefront OBJ: the "v" lines are the points; every other line is kept.
#include <charconv>

#include "io/formats.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

class ObjSource : public TextSource {
 public:
  using TextSource::TextSource;

  Faces faces() const override {
    Faces faces;
    std::string_view rest = bytes(), line;
    std::uint64_t seen = 0;
    while (next_line(rest, line)) {
      if (is_row(line, RowRule::vertices)) {
        ++seen;
        continue;
      }
      std::string_view words = line, word;
      if (!next_word(words, word) || word != "f") continue;
      while (next_word(words, word)) faces.corners.push_back(corner(word, seen, line));
      faces.ends.push_back(faces.corners.size());
    }
    return faces;
  }

 protected:
  std::string header(const AddedAttributes&) const override { return {}; }

 private:
  // "7", "7/1", "7//3", and "-1" for the last point so far.
  std::uint32_t corner(std::string_view word, std::uint64_t seen, std::string_view line) const {
    std::int64_t number = 0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    const bool whole = error == std::errc() && (stop == word.data() + word.size() || *stop == '/');
    if (number < 0) number += static_cast<std::int64_t>(seen) + 1;
    if (!whole || number < 1 || static_cast<std::uint64_t>(number) > layout().count) {
      fail(name(), "line " + std::to_string(line_number(bytes(), line.data())) + ": " + quoted(word) +
                       " is no point of the file; repair the line");
    }
    return static_cast<std::uint32_t>(number - 1);
  }
};

}  // namespace

std::shared_ptr<Source> read_obj(FileBytes bytes, const std::string& name) {
  const std::string_view text = bytes.view();
  TextLayout layout;
  layout.rule = RowRule::vertices;
  layout.rows = find_rows(text, layout.rule);
  layout.count = layout.rows.count();
  layout.extendable = false;
  if (layout.count == 0) fail(name, "has no points: no line begins with 'v'; choose another file");
  layout.columns = {ColumnKind::other, ColumnKind::x, ColumnKind::y, ColumnKind::z};
  const std::string_view first = text.substr(begin_of_row(text, layout.rows, layout.rule, 0));
  const std::size_t words = words_of(first.substr(0, first.find('\n'))).size();
  if (words == 7 || words == 8) {
    constexpr const char* kNames[] = {"red", "green", "blue", "alpha"};
    for (std::size_t c = 4; c < words; ++c)
      layout.attributes.push_back({{kNames[c - 4], NativeType::float32, 1}, c, true});
  }
  return std::make_shared<ObjSource>(std::move(bytes), name, Format::obj, std::move(layout));
}

void write_obj(Table table, Output& out) {
  use_ply_names(table);
  std::vector<std::array<std::uint8_t, 3>> colors;
  const bool colored = colors_as_bytes(table, colors);
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    buffer += 'v';
    for (const double value : table.positions[i]) {
      buffer += ' ';
      append_as(buffer, value, native(table.coordinate_type));
    }
    for (std::size_t c = 0; colored && c < 3; ++c) {
      buffer += ' ';
      append_number(buffer, static_cast<float>(colors[i][c]) / 255.0F);
    }
    buffer += '\n';
  });
  write_rows(out, table.faces.ends.size(), [&](std::size_t face, std::string& buffer) {
    buffer += 'f';
    const std::uint64_t begin = face == 0 ? 0 : table.faces.ends[face - 1];
    for (std::uint64_t c = begin; c < table.faces.ends[face]; ++c) {
      buffer += ' ' + std::to_string(std::uint64_t{table.faces.corners[c]} + 1);
    }
    buffer += '\n';
  });
}

}  // namespace pointfair::io
