// SPDX-License-Identifier: Apache-2.0
// STL files of text: "facet normal", three lines "vertex", "endfacet", again and again.
#include "io/text.hpp"

#include <algorithm>

#include "io/narrowest.hpp"
#include "io/parallel.hpp"
#include "io/plain_row.hpp"
#include "io/stl/facets.hpp"

namespace pointfair::io::stl {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 18;

// The part of the text that begins with the line of a facet, unless it is the first one.
struct Chunk {
  std::size_t begin = 0;
  std::uint64_t first_facet = 0;  ///< facets before it
};

enum class Line : std::uint8_t { facet, vertex, end_of_solid, other };

bool begins_with(std::string_view line, std::string_view word) {
  if (line.size() < word.size()) return false;
  for (std::size_t i = 0; i < word.size(); ++i)
    if ((line[i] | 0x20) != word[i]) return false;
  return line.size() == word.size() || is_blank(line[word.size()]);
}

// What a line is; its first word goes off its front.
Line kind_of(std::string_view& line) {
  std::size_t blanks = 0;
  while (blanks < line.size() && is_blank(line[blanks])) ++blanks;
  line.remove_prefix(blanks);
  const auto take = [&](std::string_view word, Line kind) {
    if (!begins_with(line, word)) return Line::other;
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

class TextStl final : public Source {
 public:
  TextStl(FileBytes file, std::string file_name)
      : Source(std::move(file), std::move(file_name), Format::stl, Encoding::ascii) {
    cut();
    count();
  }

  std::size_t block_count() const override { return chunks_.size() - 1; }
  std::uint64_t block_begin(std::size_t block) const override { return 3 * chunks_[block].first_facet; }
  void positions(std::size_t block, std::span<Position> out) const override {
    for_each_line(block, [&](Line kind, std::string_view line, std::size_t, std::size_t corner) {
      if (kind == Line::vertex) out[corner] = position_of(line);
    });
  }
  ScalarType coordinate_type() const override {
    if (origin() != Position{}) return ScalarType::float64;
    std::vector<Narrowest> seen(block_count());
    for_each_block(seen.size(), [&](std::size_t block) {
      for_each_line(block, [&](Line kind, std::string_view line, std::size_t, std::size_t) {
        if (kind != Line::vertex) return;
        for (std::string_view word; next_word(line, word);) seen[block].see(word);
      });
    });
    const bool all = std::all_of(seen.begin(), seen.end(), [](const Narrowest& n) { return n.fits_float; });
    return all ? ScalarType::float32 : ScalarType::float64;
  }
  std::vector<Column> columns() const override { return {}; }
  void extract_block(std::size_t, std::size_t, std::span<char>) const override {}
  void visit_faces(FaceVisitor& visitor) const override { visit_facets(chunks_.back().first_facet, visitor); }

 protected:
  void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override {
    PatchedText patched(chunk(block), to);
    for_each_line(block, [&](Line kind, std::string_view line, std::size_t facet, std::size_t corner) {
      if (kind == Line::facet && 3 * facet + 2 < moves.changed.size() && has_moved(moves, 3 * facet))
        renew_normal(line, normal_of(moves.values, 3 * facet), patched);
      if (kind == Line::vertex && moves.changed[corner] != 0) move_corner(line, moves, corner, edits, patched);
    });
    patched.finish();
  }

 private:
  // Cuts the text where facets begin.
  void cut() {
    const std::string_view text = bytes();
    chunks_.push_back({});
    for (std::size_t at = kChunk; at < text.size();) {
      const std::size_t end = text.find('\n', at);
      if (end == std::string_view::npos) break;
      at = end + 1;
      std::string_view line = text.substr(at, text.find('\n', at) - at);
      if (kind_of(line) != Line::facet) continue;
      chunks_.push_back({at, 0});
      at += kChunk;
    }
    chunks_.push_back({text.size(), 0});
  }

  // Checks that each facet has three corners, and that the file ends where it says.
  void count() {
    std::vector<std::uint8_t> ended(block_count());
    for_each_block(block_count(), [&](std::size_t block) {
      std::size_t facets = 0, corners = 0;
      for_each_line(block, [&](Line kind, std::string_view line, std::size_t facet, std::size_t corner) {
        if (kind == Line::end_of_solid) ended[block] = 1;
        if (kind == Line::facet) {
          if (corner != 3 * facet)
            fail_at(line.data(), "a facet begins where another has not three corners; repair the file");
          facets = facet + 1;
          ended[block] = 0;
        } else if (kind == Line::vertex) {
          if (corner + 1 > 3 * facet)
            fail_at(line.data(), "a corner that belongs to no facet of three; repair the file");
          corners = corner + 1;
        }
      });
      if (corners != 3 * facets) fail(name(), "ends within a facet, or a facet lacks a corner; copy the file again");
      chunks_[block + 1].first_facet = facets;
    });
    for (std::size_t c = 0; c + 1 < chunks_.size(); ++c) chunks_[c + 1].first_facet += chunks_[c].first_facet;
    if (!ended.back()) fail(name(), "ends without 'endsolid'; copy the file again, or add that line");
    if (chunks_.back().first_facet == 0) fail(name(), "has no facets; choose another file");
    if (chunks_.back().first_facet > 0xFFFFFFFF / 3) fail(name(), "has more corners than can be counted; cut the mesh");
  }

  std::string_view chunk(std::size_t block) const {
    return bytes().substr(chunks_[block].begin, chunks_[block + 1].begin - chunks_[block].begin);
  }

  // Calls visit(kind, line behind its first word, facet, corner): the numbers of the next of both in the chunk; of the
  // line of a facet its own, and of lines of corners how many facets have begun.
  template <class Visit>
  void for_each_line(std::size_t block, const Visit& visit) const {
    std::string_view rest = chunk(block), line;
    std::size_t facet = 0, corner = 0;
    while (next_line(rest, line)) {
      const Line kind = kind_of(line);
      if (kind == Line::other) continue;
      visit(kind, line, facet, corner);
      facet += kind == Line::facet;
      corner += kind == Line::vertex;
    }
  }

  Position position_of(std::string_view line) const {
    Position result;
    if (PlainRow(line, ' ').position(result)) return result;
    std::string_view rest = line, word;
    for (double& value : result) {
      const std::optional<double> number = next_word(rest, word) ? to_number(word) : std::nullopt;
      if (!number) fail_at(line.data(), "a corner needs three numbers: " + quoted(line) + "; repair the line");
      value = *number;
    }
    return result;
  }

  static void renew_normal(std::string_view line, const std::array<float, 3>& normal, PatchedText& patched) {
    std::string_view word;
    next_word(line, word);  // "normal"
    for (const float value : normal) {
      if (!next_word(line, word)) return;
      std::string text;
      append_number(text, value);
      patched.replace(word, text);
    }
  }

  void move_corner(std::string_view line, const Moves& moves, std::size_t corner, const Edits& edits,
                   PatchedText& patched) const {
    std::string_view word;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      next_word(line, word);
      if ((moves.changed[corner] >> axis & 1) == 0) continue;
      const double value = moves.values[corner][axis];
      std::string text;
      if (edits.placed) {
        append_number(text, value);
      } else {
        append_moved(text, word, value, static_cast<float>(value - origin()[axis]));
      }
      patched.replace(word, text);
    }
  }

  std::vector<Chunk> chunks_;  ///< and a last one for the end of the text
};

}  // namespace

std::shared_ptr<Source> read_text(FileBytes bytes, const std::string& name) {
  return std::make_shared<TextStl>(std::move(bytes), name);
}

}  // namespace pointfair::io::stl
