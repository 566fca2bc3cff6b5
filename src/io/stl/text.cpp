// SPDX-License-Identifier: Apache-2.0
// STL files of text: "facet normal", three lines "vertex", "endfacet", again and again.
#include <algorithm>

#include "io/parallel.hpp"
#include "io/stl/facets.hpp"
#include "io/text_source.hpp"

namespace pointfair::io::stl {
namespace {

enum class Line : std::uint8_t { facet, vertex, end_of_solid, other };

// What a line is; its first word goes off its front.
Line kind_of(std::string_view& line) {
  std::size_t blanks = 0;
  while (blanks < line.size() && is_blank(line[blanks])) ++blanks;
  line.remove_prefix(blanks);
  const auto take = [&](std::string_view word, Line kind) {
    if (!begins_with_word(line, word)) return Line::other;
    line.remove_prefix(word.size());
    return kind;
  };
  switch (line.empty() ? ' ' : line[0] | 0x20) {
    case 'v':
      return take("vertex", Line::vertex);
    case 'f':
      return take("facet", Line::facet);
    case 'e':
      return take("endsolid", Line::end_of_solid);
    default:
      return Line::other;
  }
}

// Calls visit(kind, line behind its first word, facet, corner): the numbers of the next of both in the text; of the
// line of a facet its own, and of lines of corners how many facets have begun.
template <class Visit>
void visit_lines(std::string_view text, const Visit& visit) {
  std::size_t facet = 0, corner = 0;
  for (std::string_view line; next_line(text, line);) {
    const Line kind = kind_of(line);
    if (kind == Line::other) continue;
    visit(kind, line, facet, corner);
    facet += kind == Line::facet;
    corner += kind == Line::vertex;
  }
}

// Cuts the text where facets begin.
TextRows cut(std::string_view text) {
  constexpr std::size_t kChunk = std::size_t{1} << 18;
  TextRows rows{{{}}};
  for (std::size_t at = kChunk; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos) break;
    at = end + 1;
    std::string_view line = text.substr(at, text.find('\n', at) - at);
    if (kind_of(line) != Line::facet) continue;
    rows.chunks.push_back({at, 0});
    at += kChunk;
  }
  rows.chunks.push_back({text.size(), 0});
  return rows;
}

// The corners. Checks that each facet has three, and that the file ends where it says.
TextRows find_corners(std::string_view text, const std::string& name) {
  const auto fail_at = [&](std::string_view line, const std::string& message) {
    fail(name, "line " + std::to_string(line_number(text, line.data())) + ": " + message);
  };
  TextRows rows = cut(text);
  auto& chunks = rows.chunks;
  std::vector<std::uint8_t> ended(chunks.size() - 1);
  for_each_block(ended.size(), [&](std::size_t block) {
    std::size_t facets = 0, corners = 0;
    const std::string_view part = text.substr(chunks[block].begin, chunks[block + 1].begin - chunks[block].begin);
    visit_lines(part, [&](Line kind, std::string_view line, std::size_t facet, std::size_t corner) {
      if (kind == Line::end_of_solid) ended[block] = 1;
      if (kind == Line::facet) {
        if (corner != 3 * facet) fail_at(line, "a facet begins where another has not three corners; repair the file");
        facets = facet + 1;
        ended[block] = 0;
      } else if (kind == Line::vertex) {
        if (corner + 1 > 3 * facet) fail_at(line, "a corner that belongs to no facet of three; repair the file");
        corners = corner + 1;
      }
    });
    if (corners != 3 * facets) fail(name, "ends within a facet, or a facet lacks a corner; copy the file again");
    chunks[block + 1].first_row = corners;
  });
  for (std::size_t c = 0; c + 1 < chunks.size(); ++c) chunks[c + 1].first_row += chunks[c].first_row;
  if (!ended.back()) fail(name, "ends without 'endsolid'; copy the file again, or add that line");
  if (rows.count() == 0) fail(name, "has no facets; choose another file");
  if (rows.count() > 0xFFFFFFFF) fail(name, "has more corners than can be counted; cut the mesh");
  return rows;
}

void renew_normal(std::string_view line, const std::array<float, 3>& normal, PatchedText& patched) {
  std::string_view word;
  next_word(line, word);  // "normal"
  for (const float value : normal) {
    if (!next_word(line, word)) return;
    std::string text;
    append_number(text, value);
    patched.replace(word, text);
  }
}

class TextStl final : public TextSource {
 public:
  using TextSource::TextSource;

  void visit_faces(FaceVisitor& visitor) const override { visit_facets(layout().count / 3, visitor); }

  std::vector<Content> contents() const override {
    std::vector<Content> result = TextSource::contents();
    std::uint64_t solids = 0, names = 0;
    std::string_view text = bytes(), line, word;
    while (next_line(text, line)) {
      if (!begins_with_word(line = without_blanks(line), "solid")) continue;
      ++solids;
      next_word(line, word);
      const std::string_view name = without_blanks(line);
      names += !name.empty() && name != kOwnName;
    }
    release_all();
    if (names > 0) result.push_back({ContentKind::groups, counted(names, "name") + " of parts"});
    if (solids > 1) result.push_back({ContentKind::groups, "the borders of " + counted(solids, "part")});
    return result;
  }

 protected:
  void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override {
    std::string moved;
    TextSource::append_block(block, moves, edits, moved);
    PatchedText patched(moved, to);
    visit_lines(moved, [&](Line kind, std::string_view line, std::size_t facet, std::size_t) {
      if (kind == Line::facet && has_moved(moves, 3 * facet))
        renew_normal(line, normal_of(moves.values, 3 * facet), patched);
    });
    patched.finish();
  }
};

}  // namespace

std::shared_ptr<Source> read_text(FileBytes bytes, const std::string& name) {
  TextLayout layout;
  layout.shape.rule = RowRule::corners;
  layout.columns = {ColumnKind::other, ColumnKind::x, ColumnKind::y, ColumnKind::z};
  layout.extendable = false;
  layout.advice = "repair the line";
  layout.rows = find_corners(bytes.view(), name);
  layout.count = layout.rows.count();
  return std::make_shared<TextStl>(std::move(bytes), name, Format::stl, std::move(layout));
}

}  // namespace pointfair::io::stl
