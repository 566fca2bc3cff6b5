// SPDX-License-Identifier: Apache-2.0
// Reading and writing Wavefront OBJ: the "v" lines are the points; every other line is kept.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <numeric>

#include "io/colors.hpp"
#include "io/formats.hpp"
#include "io/obj_lines.hpp"
#include "io/obj_parts.hpp"
#include "io/parallel.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

// The lines of an OBJ file without some of its points. All other lines stay as they are: materials, parts, texture
// coordinates, remarks.
class ObjRemoval {
 public:
  // Without the points of which `removed` is not 0. `own_normals`: as ObjParts has it; then their normals go with them.
  // Takes 4 bytes a point.
  ObjRemoval(std::span<const std::uint8_t> removed, bool own_normals, const RowShape& shape)
      : left_before_{0}, own_normals_(own_normals), shape_(shape) {
    left_before_.reserve(removed.size() + 1);
    for (const std::uint8_t gone : removed) left_before_.push_back(left_before_.back() + (gone == 0));
  }

  // Appends the lines of `text`, before which the file has so many points and normals. Points that are removed go, with
  // the faces and lines (l) that have one as a corner; a list of points (p) loses those. What is left names the same
  // points by their new numbers, counted from the end where it was. Every number must be one of a point.
  void append(std::string_view text, std::uint64_t points, std::uint64_t normals, std::string& to) const {
    constexpr std::uint64_t kMany = std::uint64_t{1} << 30;  // so that what is counted from the end, and kept, is read
    Lines lines{*this, {points, own_normals_ ? normals : kMany, kMany}, to};
    std::string_view line;
    while (next_row(text, line, shape_))
      lines.append({line.data(), static_cast<std::size_t>(text.data() - line.data())});
  }

 private:
  // A walk over lines of the file.
  struct Lines {
    const ObjRemoval& removal;
    LinesSoFar so_far;
    std::string& to;

    std::uint32_t left_before(std::uint64_t point) const { return removal.left_before_[point]; }

    // The new number of what had `text` as its number, of which there were `before` lines before.
    std::string number(std::int64_t index, std::string_view text, std::uint64_t before) const {
      const std::int64_t now = left_before(static_cast<std::uint64_t>(index));
      if (now == index && !text.starts_with('-')) return std::string(text);  // as it is written
      return std::to_string(text.starts_with('-') ? now - std::int64_t{left_before(before)} : now + 1);
    }

    // `words`: the corners in the line. A list has points that do not depend on each other.
    void append_corners(std::string_view line, std::string_view words, bool is_list) {
      const std::size_t begin = to.size();
      PatchedText patched(line, to);
      std::size_t corners_seen = 0, left = 0;
      Corners corners(words, so_far, removal.left_before_.size() - 1);
      for (Corner corner; corners.next(corner); ++corners_seen) {
        if (!removal.is_removed(static_cast<std::uint64_t>(corner.point))) {
          ++left;
          patched.replace(corner.point_text, number(corner.point, corner.point_text, so_far.points));
          if (!removal.own_normals_ || corner.normal < 0) continue;
          patched.replace(corner.normal_text, number(corner.normal, corner.normal_text, so_far.normals));
        } else if (is_list) {
          patched.replace(corner.point_text, {});
        } else {
          return to.resize(begin);
        }
      }
      if (left == 0 && corners_seen > 0) return to.resize(begin);
      patched.finish();
    }

    // `line` with its end.
    void append(std::string_view line) {
      std::string_view words = line;
      const ObjLine kind = take_key(words);
      const bool has_key = kind == ObjLine::other && words.size() > 1 && is_blank(words[1]);
      const bool is_line = has_key && words[0] == 'l', is_list = has_key && words[0] == 'p';
      if (kind == ObjLine::face || is_line || is_list) {
        append_corners(line, kind == ObjLine::face ? words : words.substr(1), is_list);
      } else if (!(kind == ObjLine::point && removal.is_removed(so_far.points)) &&
                 !(kind == ObjLine::normal && removal.own_normals_ && removal.is_removed(so_far.normals))) {
        to += line;
      }
      so_far.take(kind);
    }
  };

  bool is_removed(std::uint64_t point) const { return left_before_[point] == left_before_[point + 1]; }

  std::vector<std::uint32_t> left_before_;  // points; one more than the file has
  bool own_normals_;
  RowShape shape_;
};

class ObjSource : public TextSource {
 public:
  using TextSource::TextSource;

  // Lines of faces that are damaged pass through where nothing asks for faces.
  void visit_faces(FaceVisitor& visitor) const override {
    if (!parts().damage.empty()) fail(name(), parts().damage);
    visit_obj_faces(text(), parts(), visitor);
  }

  Materials materials() const override { return parts().materials; }

  FaceSummary face_summary() const override {
    if (!parts().damage.empty()) fail(name(), parts().damage);
    return {parts().faces.faces, parts().textured};
  }

  std::vector<Column> columns() const override {
    std::vector<Column> columns = TextSource::columns();
    if (!point_normals().empty()) {
      for (const std::string_view name : kNormals) columns.push_back({std::string(name), NativeType::float32, 1});
    }
    return columns;
  }

  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override {
    if (index < attribute_count()) return TextSource::extract_block(index, block, out);
    const std::size_t first = static_cast<std::size_t>(block_begin(block));
    for (std::size_t i = 0; i < block_size(block); ++i) {
      const float value = point_normals().of(first + i)[index - attribute_count()];
      std::copy_n(reinterpret_cast<const char*>(&value), sizeof value, out.data() + i * sizeof value);
    }
  }

  std::string why_fixed(std::size_t column) const override {
    if (column < attribute_count()) return {};
    return "OBJ files have normals on lines of their own, which are not renewed; choose PLY, or leave them as they are";
  }

  bool leaves_points_out() const override { return parts().can_lose_points; }

  void write(const Edits& edits, Encoding encoding, Output& out) const override {
    if (edits.removed.empty()) return TextSource::write(edits, encoding, out);
    if (!parts().damage.empty()) fail(name(), parts().damage);
    const ObjRemoval removal(edits.removed, parts().own_normals, layout().shape);
    const std::vector<std::uint64_t> normals = normals_before_blocks();
    out.write(header(edits));
    write_blocks(out, block_count(), [&](std::size_t block, std::string& buffer) {
      std::string whole;
      append_block(block, moves(block, edits), edits, whole);
      removal.append(whole, block_begin(block), normals[block], buffer);
    });
    out.write(tail());
  }

  std::vector<Content> contents() const override {
    std::vector<Content> result = TextSource::contents();
    const ObjParts& all = parts();
    result.insert(result.end(), all.contents.begin(), all.contents.end());
    if (all.normals > 0 && point_normals().empty())
      result.push_back({ContentKind::corner_normals, counted(all.normals, "normal") + " of corners of faces"});
    return result;
  }

 private:
  const ObjParts& parts() const {
    std::call_once(parsed_, [this] { parts_ = read_obj_parts(text()); });
    return parts_;
  }

  // Of the file, where its normals go with its points; else none counts.
  std::vector<std::uint64_t> normals_before_blocks() const {
    std::vector<std::uint64_t> before(block_count() + 1);
    if (!parts().own_normals) return before;
    for_each_block(block_count(), [&](std::size_t block) {
      LinesSoFar so_far;
      io::for_each_line({block_text(block), bytes(), layout().shape, layout().count, [](std::string_view) {}},
                        [&](ObjLine kind, std::string_view, std::string_view) { so_far.take(kind); });
      before[block + 1] = so_far.normals;
    });
    std::partial_sum(before.begin(), before.end(), before.begin());
    return before;
  }

  ObjText text() const {
    return {bytes().substr(layout().begin), bytes(), layout().shape, layout().count,
            [this](std::string_view part) { release(part); }};
  }

  // Files without normals are not parsed for them.
  const ObjNormals& point_normals() const {
    static const ObjNormals kNone;
    std::call_once(looked_, [this] {
      std::atomic<bool> found{false};
      for_each_block(block_count(), [&](std::size_t block) {
        if (!found && has_obj_normals(block_text(block), layout().shape)) found = true;
        release(block_text(block));
      });
      has_normals_ = found;
    });
    return has_normals_ ? parts().point_normals : kNone;
  }

  mutable std::once_flag parsed_, looked_;
  mutable ObjParts parts_;
  mutable bool has_normals_ = false;
};

// The number of each corner's line of texture coordinates; 0 for corners without.
std::vector<std::uint64_t> texture_lines(const std::vector<float>& texture) {
  std::vector<std::uint64_t> lines(texture.size() / 2);
  std::uint64_t last = 0;
  for (std::size_t corner = 0; corner < lines.size(); ++corner)
    if (!std::isnan(texture[2 * corner])) lines[corner] = ++last;
  return lines;
}

}  // namespace

std::shared_ptr<Source> read_obj(FileBytes bytes, const std::string& name, const Reading&) {
  const std::string_view text = bytes.view();
  TextLayout layout;
  layout.begin = byte_order_mark(text);
  layout.shape = {RowRule::vertices, line_end_of(text), 0};
  const std::string_view body = text.substr(layout.begin);
  layout.rows = find_rows(body, layout.shape);
  layout.count = layout.rows.count();
  layout.extendable = false;
  if (layout.count == 0) fail(name, "has no points: no line begins with 'v'; choose another file");
  layout.columns = {ColumnKind::other, ColumnKind::x, ColumnKind::y, ColumnKind::z};
  std::string_view rest = body.substr(begin_of_row(body, layout.rows, layout.shape, 0)), first;
  next_row(rest, first, layout.shape);
  if (words_of(first.substr(0, first.find('#'))).size() == 5) {
    layout.attributes.push_back({{"w", NativeType::float32, 1}, 4, true, true});
  } else {  // some points may have no colour
    constexpr const char* kNames[] = {"red", "green", "blue", "alpha"};
    for (std::size_t c = 0; c < 4; ++c)
      layout.attributes.push_back({{kNames[c], NativeType::float32, 1}, 4 + c, true, true});
  }
  return std::make_shared<ObjSource>(std::move(bytes), name, Format::obj, std::move(layout));
}

void write_obj(Table table, const Writing&, Output& out) {
  use_ply_names(table, ColorDepth::any);  // bytes would be white where there is no colour
  const ByteColors colors = colors_as_bytes(table);
  const auto normals = table.find_all(kNormals);
  const std::vector<std::uint64_t> textures = texture_lines(table.faces.texture);
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    buffer += "v ";
    append_position(buffer, table, i, ' ');
    for (std::size_t c = 0; colors.has(i) && c < 3; ++c) {
      append_number(buffer, static_cast<float>(colors.values[i][c]) / 255.0F);
      buffer += ' ';
    }
    buffer.back() = '\n';
  });
  write_rows(out, textures.size(), [&](std::size_t i, std::string& buffer) {
    if (textures[i] == 0) return;
    append_number(buffer += "vt ", table.faces.texture[2 * i]);
    append_number(buffer += ' ', table.faces.texture[2 * i + 1]);
    buffer += '\n';
  });
  write_rows(out, normals.empty() ? 0 : table.size(), [&](std::size_t i, std::string& buffer) {
    buffer += "vn ";
    for (const TableColumn* column : normals) append_value(buffer, *column, i, ' ');
    buffer.back() = '\n';
  });
  write_rows(out, table.faces.ends.size(), [&](std::size_t face, std::string& buffer) {
    buffer += 'f';
    for (std::size_t c = table.faces.begin_of(face); c < table.faces.ends[face]; ++c) {
      const std::string point = std::to_string(std::uint64_t{table.faces.corners[c]} + 1);
      buffer += ' ' + point;
      const bool textured = !textures.empty() && textures[c] != 0;
      if (textured) buffer += '/' + std::to_string(textures[c]);
      if (!normals.empty()) buffer += (textured ? "/" : "//") + point;
    }
    buffer += '\n';
  });
}

}  // namespace pointfair::io
