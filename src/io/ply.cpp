// SPDX-License-Identifier: Apache-2.0
// Reading PLY, and writing back a PLY file with moved points.
#include <algorithm>

#include "io/formats.hpp"
#include "io/no_points.hpp"
#include "io/parallel.hpp"
#include "io/ply_body.hpp"
#include "io/ply_faces.hpp"
#include "io/ply_header.hpp"
#include "io/ply_rows.hpp"
#include "io/record_source.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

std::string counted(std::uint64_t count, const PlyElement& element) {
  return std::to_string(count) + (element.name == "vertex" ? " points" : " rows of '" + element.name + "'");
}

[[noreturn]] void fail_short(const std::string& name, const PlyElement& element, std::uint64_t found) {
  fail(name, "header promises " + counted(element.count, element) + ", file ends after " + std::to_string(found) +
                 "; copy the file again or correct the header");
}

[[noreturn]] void fail_long(const std::string& name, const PlyElement& element, const std::string& more) {
  fail(name,
       "header promises " + counted(element.count, element) + ", " + more + "; correct the header or cut the file");
}

std::array<std::size_t, 3> find_xyz(const PlyElement& vertex, const std::string& name) {
  std::array<std::size_t, 3> xyz{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string wanted(1, static_cast<char>('x' + axis));
    xyz[axis] = find_property(vertex, wanted);
    if (xyz[axis] == vertex.properties.size())
      fail(name, "the points have no property '" + wanted + "'; name the coordinates x, y, z in the header");
    if (vertex.properties[xyz[axis]].list_count)
      fail(name, "property '" + wanted + "' of the points is a list; a coordinate must be one number");
  }
  return xyz;
}

// A PLY file whose points are lines of text or binary records, as Base says.
template <class Base>
class PlySource : public Base {
 public:
  template <class... Arguments>
  PlySource(PlyFile file, Arguments&&... arguments)
      : Base(std::forward<Arguments>(arguments)...), file_(std::move(file)) {}

  void visit_faces(FaceVisitor& visitor) const override {
    io::visit_faces(file_, this->bytes(), this->name(), visitor, [this](std::size_t begin, std::size_t end) {
      if (this->encoding() == Encoding::ascii) this->release(this->bytes().substr(begin, end - begin));
    });
  }

  Materials materials() const override {
    const std::optional<FaceList> faces = find_faces(file_);
    Materials result;
    if (!faces) return result;
    if (std::ranges::none_of(file_.header.elements[faces->element].properties, is_texture) &&
        texture_columns(Base::columns()).empty())
      return result;
    for (const std::string& image : file_.header.textures) result.all.push_back({{}, image});
    return result;
  }

  std::vector<Content> contents() const override {
    std::vector<Content> result = Base::contents();
    const PlyHeader& header = file_.header;
    for (const PlyProperty& property : file_.vertex().properties)
      if (property.list_count)
        result.push_back({ContentKind::lists, "the lists '" + property.name + "' of the points"});
    const std::optional<FaceList> faces = find_faces(file_);
    for (std::size_t e = 0; e < header.elements.size(); ++e) {
      const PlyElement& element = header.elements[e];
      if (e == header.vertex || element.count == 0) continue;
      if (!faces || e != faces->element) {
        result.push_back({ContentKind::elements, io::counted(element.count, "row") + " of '" + element.name + "'"});
        continue;
      }
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        if (p != faces->property && !is_texture(element.properties[p]))
          result.push_back({ContentKind::face_values, "'" + element.properties[p].name + "' of the faces"});
      }
    }
    for (const std::string& texture : header.textures)
      result.push_back({ContentKind::materials, "the image " + texture});
    if (header.comments > 0) result.push_back({ContentKind::comments, io::counted(header.comments, "comment")});
    return result;
  }

  bool leaves_points_out() const override { return can_lose_points(file_); }

  void write(const Edits& edits, Encoding encoding, Output& out) const override {
    if (encoding == this->encoding() && edits.removed.empty()) return Base::write(edits, encoding, out);
    const PlyRows rows(file_, this->bytes(), this->name(), edits.removed);
    out.write(ply_header_with(rows.counts(), ply_header_text(file_.header, encoding, edits.added), file_.header));
    for (std::size_t e = 0; e < file_.header.elements.size(); ++e) {
      if (e == file_.header.vertex) {
        transcode_points(edits, encoding, out);
      } else {
        rows.write(e, encoding, out);
      }
    }
  }

 protected:
  std::string header(const Edits& edits) const override {
    const auto points_begin = file_.begins[file_.header.vertex];
    std::string result = ply_header_text(file_.header, this->encoding(), edits.added);
    if (std::is_same_v<Base, RecordSource> || file_.wrapped)
      result += this->bytes().substr(file_.header.text.size(), points_begin - file_.header.text.size());
    return result;
  }

 private:
  void transcode_points(const Edits& edits, Encoding encoding, Output& out) const {
    write_blocks(out, this->block_count(), [&](std::size_t block, std::string& buffer) {
      const Moves moves = this->moves(block, edits);
      const std::uint64_t first = this->block_begin(block);
      if (moves.values.empty()) return;
      PlyCursor cursor(this->bytes(), point_begin(first), file_.header, file_.wrapped, this->name());
      PlyEmitter emitter(buffer, encoding, file_.header.line_end);
      for (std::size_t i = 0; i < moves.values.size(); ++i) {
        const std::size_t begin = buffer.size();
        copy_row(cursor, file_.vertex(), emitter, [&](std::size_t p) {
          return put_value(cursor, p, first + i, moves.values[i], edits.replaced, emitter);
        });
        for_each_value(edits.added, first + i,
                       [&](const char* value, NativeType type) { emitter.put(load_double(value, type, false), type); });
        emitter.end_row();
        if (!edits.removed.empty() && edits.removed[static_cast<std::size_t>(first) + i] != 0) buffer.resize(begin);
      }
    });
  }

  // Puts a coordinate or new value of a property at a point; false: the file's own stays.
  bool put_value(PlyCursor& cursor, std::size_t property, std::uint64_t point, const Position& position,
                 const std::vector<Replacement>& replaced, PlyEmitter& emitter) const {
    const auto axis = static_cast<std::size_t>(std::ranges::find(xyz_, property) - xyz_.begin());
    const Replacement* const other = this->find_replacement(replaced, property);
    if (axis == 3 && !other) return false;
    const NativeType type = file_.vertex().properties[property].type;
    cursor.next(type);
    emitter.put(axis < 3 ? position[axis] : other->value(point, 0), type);
    return true;
  }

  std::size_t point_begin(std::uint64_t point) const {
    if constexpr (std::is_same_v<Base, RecordSource>) {
      return file_.begins[file_.header.vertex] + this->record_begin(point);
    } else {
      return this->row_begin(this->layout().first_row + point);
    }
  }

  PlyFile file_;
  std::array<std::size_t, 3> xyz_ = find_xyz(file_.vertex(), this->name());
};

RecordLayout record_layout(const PlyFile& file, const std::string& name) {
  RecordLayout layout{.begin = file.begins[file.header.vertex],
                      .count = file.vertex().count,
                      .xyz = find_xyz(file.vertex(), name),
                      .record_size = record_size(file.vertex()).value_or(0),
                      .swap = must_swap(file.header.encoding)};
  std::size_t offset = 0;
  for (const PlyProperty& property : file.vertex().properties) {
    layout.fields.push_back({{property.name, property.type}, offset, layout.record_size, property.list_count});
    offset += size_of(property.type);
  }
  return layout;
}

// Walks an element with lists. Appends the begin of each row to `starts` where it is given, and returns the end.
std::size_t walk_lists(std::string_view bytes, std::size_t at, const PlyHeader& header, const PlyElement& element,
                       const std::string& name, std::vector<std::uint64_t>* starts) {
  const std::size_t begin = at;
  std::size_t least = 0;  // bytes of a row whose lists are empty
  for (const PlyProperty& p : element.properties) least += size_of(p.list_count.value_or(p.type));
  const std::uint64_t room = (bytes.size() - at) / least;
  if (element.count > room) fail_short(name, element, room);
  if (starts) starts->reserve(static_cast<std::size_t>(element.count + 1));
  PlyCursor cursor(bytes, at, header, false, name);
  for (std::uint64_t row = 0; row < element.count; ++row) {
    if (starts) starts->push_back(cursor.position() - begin);
    try {
      for (const PlyProperty& property : element.properties) cursor.skip(property);
    } catch (const Error&) {
      fail_short(name, element, row);
    }
  }
  if (starts) starts->push_back(cursor.position() - begin);
  return cursor.position();
}

std::shared_ptr<Source> read_binary(FileBytes bytes, PlyFile file, const std::string& name) {
  const std::string_view view = bytes.view();
  const auto& elements = file.header.elements;
  std::vector<std::uint64_t> starts;
  std::size_t at = file.header.text.size();
  for (std::size_t e = 0; e < elements.size(); ++e) {
    file.begins.push_back(at);
    const std::optional<std::size_t> size = record_size(elements[e]);
    if (!size) {
      at = walk_lists(view, at, file.header, elements[e], name, e == file.header.vertex ? &starts : nullptr);
    } else if (*size > 0) {
      const std::uint64_t room = (view.size() - at) / *size;
      if (elements[e].count > room) fail_short(name, elements[e], room);
      at += static_cast<std::size_t>(elements[e].count) * *size;
    }
  }
  file.begins.push_back(at);
  // Some writers end a binary file with a line end.
  if (view.substr(at).find_first_not_of(std::string_view("\r\n\0", 3)) != std::string_view::npos)
    fail_long(name, elements.back(), std::to_string(view.size() - at) + " bytes follow the last");
  RecordLayout layout = record_layout(file, name);
  layout.starts = std::move(starts);
  const std::string_view points = view.substr(layout.begin, file.begins[file.header.vertex + 1] - layout.begin);
  const Encoding encoding = file.header.encoding;
  return std::make_shared<PlySource<RecordSource>>(std::move(file), std::move(bytes), name, Format::ply, encoding,
                                                   std::move(layout), points);
}

TextLayout text_layout(const PlyFile& file, const RowShape& shape, TextRows rows, std::uint64_t first_row,
                       const std::string& name) {
  TextLayout layout;
  layout.begin = file.wrapped ? file.begins[file.header.vertex] : file.header.text.size();
  if (file.wrapped) layout.end = file.begins[file.header.vertex + 1];
  layout.shape = shape;
  layout.rows = std::move(rows);
  layout.first_row = first_row;
  layout.count = file.vertex().count;
  layout.exact = true;
  const auto xyz = find_xyz(file.vertex(), name);
  const auto& properties = file.vertex().properties;
  for (std::size_t p = 0; p < properties.size(); ++p) {
    const auto axis = static_cast<std::size_t>(std::ranges::find(xyz, p) - xyz.begin());
    if (axis < 3) {
      layout.columns.push_back(static_cast<ColumnKind>(axis));
      layout.integers = layout.integers || is_integer(properties[p].type);
      layout.doubles = layout.doubles || properties[p].type == NativeType::float64;
    } else if (properties[p].list_count) {
      layout.columns.push_back(ColumnKind::list);
    } else {
      layout.columns.push_back(ColumnKind::other);
      layout.attributes.push_back({{properties[p].name, properties[p].type, 1}, p, true});
    }
  }
  return layout;
}

// Whether the text has just the values that the header promises, whatever lines they stand on. Finds the elements.
bool find_wrapped(std::string_view bytes, PlyFile& file, const std::string& name) {
  const auto& properties = file.vertex().properties;
  if (std::ranges::any_of(properties, [](const PlyProperty& p) { return p.list_count.has_value(); })) return false;
  PlyCursor cursor(bytes, file.header.text.size(), file.header, true, name);
  std::vector<std::size_t> begins;
  try {
    cursor.begin_row();
    for (const PlyElement& element : file.header.elements) {
      begins.push_back(cursor.position());
      for (std::uint64_t row = 0; row < element.count; ++row)
        for (const PlyProperty& property : element.properties) cursor.skip(property);
    }
  } catch (const Error&) {
    return false;
  }
  begins.push_back(cursor.position());
  std::string_view rest = bytes.substr(cursor.position()), word;
  if (next_word(rest, word)) return false;
  file.begins = std::move(begins);
  file.wrapped = true;
  return true;
}

std::shared_ptr<Source> read_wrapped(FileBytes bytes, PlyFile file, const std::string& name) {
  const std::size_t begin = file.begins[file.header.vertex], end = file.begins[file.header.vertex + 1];
  const RowShape shape{RowRule::words, file.header.line_end, file.vertex().properties.size()};
  TextRows rows = find_rows(bytes.view().substr(begin, end - begin), shape);
  TextLayout layout = text_layout(file, shape, std::move(rows), 0, name);
  return std::make_shared<PlySource<TextSource>>(std::move(file), std::move(bytes), name, Format::ply,
                                                 std::move(layout));
}

std::shared_ptr<Source> read_ascii(FileBytes bytes, PlyFile file, const std::string& name) {
  const std::size_t body = file.header.text.size();
  const RowShape shape{RowRule::filled, file.header.line_end, 0};
  TextRows rows = find_rows(bytes.view().substr(body), shape);
  std::uint64_t expected = 0;
  for (const PlyElement& element : file.header.elements) expected += element.properties.empty() ? 0 : element.count;
  if (rows.count() != expected && find_wrapped(bytes.view(), file, name))
    return read_wrapped(std::move(bytes), std::move(file), name);
  std::uint64_t row = 0, first_row = 0;
  for (std::size_t e = 0; e < file.header.elements.size(); ++e) {
    const PlyElement& element = file.header.elements[e];
    if (e == file.header.vertex) first_row = row;
    file.begins.push_back(body + begin_of_row(bytes.view().substr(body), rows, shape, row));
    if (element.properties.empty()) continue;
    if (element.count > rows.count() - row) fail_short(name, element, rows.count() - row);
    row += element.count;
  }
  file.begins.push_back(bytes.view().size());
  if (row < rows.count())
    fail_long(name, file.header.elements.back(), std::to_string(rows.count() - row) + " more lines follow");
  TextLayout layout = text_layout(file, shape, std::move(rows), first_row, name);
  return std::make_shared<PlySource<TextSource>>(std::move(file), std::move(bytes), name, Format::ply,
                                                 std::move(layout));
}

}  // namespace

std::shared_ptr<Source> read_ply(FileBytes bytes, const std::string& name, const Reading&) {
  PlyFile file;
  file.header = parse_ply_header(bytes.view(), name);
  find_xyz(file.vertex(), name);
  if (file.vertex().count == 0) fail_without_points(name);
  return file.header.encoding == Encoding::ascii ? read_ascii(std::move(bytes), std::move(file), name)
                                                 : read_binary(std::move(bytes), std::move(file), name);
}

}  // namespace pointfair::io
