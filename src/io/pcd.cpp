// SPDX-License-Identifier: Apache-2.0
// Reading and writing PCD.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "io/colors.hpp"
#include "io/column_names.hpp"
#include "io/formats.hpp"
#include "io/lzf.hpp"
#include "io/parallel.hpp"
#include "io/pcd_header.hpp"
#include "io/record_source.hpp"
#include "io/sensor_source.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace {

constexpr std::size_t kSizesBytes = 8;  // before compressed data: its size and that of the data, 4 bytes each

// Compresses in pieces, in parallel: LZF data may be joined.
void write_compressed(std::string_view data, Output& out) {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  std::vector<std::string> pieces((data.size() + kPiece - 1) / kPiece);
  for_each_block(pieces.size(), [&](std::size_t p) { lzf_compress(data.substr(p * kPiece, kPiece), pieces[p]); });
  std::size_t size = 0;
  for (const std::string& piece : pieces) size += piece.size();
  if (std::max(size, data.size()) > std::numeric_limits<std::uint32_t>::max())
    throw Error(ErrorKind::usage, "a compressed PCD file holds at most 4 GiB; choose the binary encoding");
  std::string sizes;
  append_little(sizes, static_cast<std::uint32_t>(size));
  append_little(sizes, static_cast<std::uint32_t>(data.size()));
  out.write(sizes);
  for (const std::string& piece : pieces) out.write(piece);
}

// Writes columns, coordinates among them, as the data of a file in any encoding.
void write_data(const std::vector<TableColumn>& columns, std::size_t points, Encoding encoding, Output& out) {
  if (encoding == Encoding::binary_compressed) {
    std::string data;
    for (const TableColumn& column : columns) data.append(column.data.data(), column.data.size());
    return write_compressed(data, out);
  }
  write_rows(out, points, [&](std::size_t i, std::string& buffer) {
    for (const TableColumn& column : columns) {
      const std::size_t bytes = column_bytes(column), size = size_of(column.type);
      const char* from = column.data.data() + i * bytes;
      if (encoding == Encoding::binary) {
        buffer.append(from, bytes);
        continue;
      }
      for (std::uint32_t c = 0; c < column.components; ++c) {
        append_scalar(buffer, from + c * size, column.type);
        buffer += ' ';
      }
    }
    if (encoding == Encoding::ascii) buffer.back() = '\n';
  });
}

TableColumn coordinate_column(const std::vector<Position>& positions, std::size_t axis, NativeType type) {
  TableColumn column = zero_column({std::string(1, "xyz"[axis]), type}, positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i)
    store_double(column.data.data() + i * size_of(type), type, false, positions[i][axis]);
  return column;
}

// A PCD file whose points are lines of text or binary, as Base says.
template <class Base>
class PcdSource : public SensorSource<Base> {
 public:
  template <class... Arguments>
  PcdSource(PcdHeader header, std::shared_ptr<const char[]> unpacked, Arguments&&... arguments)
      : SensorSource<Base>(header.height > 1 ? header.width : 0, std::forward<Arguments>(arguments)...),
        header_(std::move(header)),
        unpacked_(std::move(unpacked)) {}

  std::vector<Content> contents() const override {
    std::vector<Content> result = Base::contents();
    if (header_.height > 1)
      result.push_back({ContentKind::grid, "the grid of " + std::to_string(header_.width) + " x " +
                                               std::to_string(header_.height) + " points"});
    if (header_.viewpoint != PcdHeader().viewpoint) result.push_back({ContentKind::poses, "the place of the sensor"});
    if (header_.others > 0)
      result.push_back({ContentKind::comments, io::counted(header_.others, "line") + " of the header"});
    return result;
  }
  std::vector<std::string> losses(Encoding to) const override {
    if (to == this->encoding() || header_.others == 0) return {};
    return {"in another encoding PCD files get a new header, without " + io::counted(header_.others, "line") +
            " of comments or of other programs"};
  }

  bool leaves_points_out() const override { return true; }

  void write(const Edits& edits, Encoding encoding, Output& out) const override {
    if (encoding != this->encoding()) {
      if (edits.removed.empty()) return write_as(edits.cloud, encoding, out);
      MemoryOutput left;
      write(edits, this->encoding(), left);
      const Cloud cloud = read(std::as_bytes(std::span(left.bytes)), this->name());
      return cloud.source->write(make_edits(cloud, std::nullopt), encoding, out);
    }
    if constexpr (std::is_same_v<Base, RecordSource>) {
      if (encoding == Encoding::binary_compressed) return write_packed(edits, out);
    }
    Base::write(edits, encoding, out);
  }

 protected:
  std::string header(const Edits& edits) const override {
    std::string text = pcd_header_text(header_, edits.added);
    if (edits.removed.empty()) return text;
    const auto left = static_cast<std::uint64_t>(std::ranges::count(edits.removed, 0));
    return pcd_header_of(text, header_.line_end, left);
  }

  // The default says nothing: many programs write it where they do not know.
  std::optional<Position> told_sensor() const override {
    const std::vector<std::string_view> words = words_of(header_.viewpoint);
    Position place{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::optional<double> value = axis < words.size() ? to_number(words[axis]) : std::nullopt;
      if (!value || !std::isfinite(*value)) return std::nullopt;
      place[axis] = *value;
    }
    return place == Position{} ? std::nullopt : std::optional(place);
  }

 private:
  void write_as(const Cloud& cloud, Encoding encoding, Output& out) const {
    Table table = make_table(cloud);
    std::vector<TableColumn> columns;
    auto next = table.columns.begin();
    for (std::size_t f = 0; f < header_.fields.size(); ++f) {
      const auto axis = static_cast<std::size_t>(std::ranges::find(header_.xyz, f) - header_.xyz.begin());
      if (axis < 3) {
        columns.push_back(coordinate_column(table.positions, axis, header_.fields[f].type));
      } else if (!is_padding(header_.fields[f])) {
        columns.push_back(std::move(*next++));
      }
    }
    std::move(next, table.columns.end(), std::back_inserter(columns));
    out.write(
        new_pcd_header({columns.begin(), columns.end()}, header_.width, header_.height, header_.viewpoint, encoding));
    write_data(columns, table.size(), encoding, out);
  }

  // The data lies field after field; added attributes go behind the last.
  void write_packed(const Edits& edits, Output& out) const {
    std::string data(this->points());
    std::atomic<bool> moved{false};
    for_each_block(this->block_count(), [&](std::size_t block) {
      const Moves moves = this->moves(block, edits);
      if (moves.are_none() && edits.replaced.empty()) return;
      moved = true;
      this->patch(block, moves, edits.replaced, data.data(), 0, 0);
    });
    if (!moved && edits.added.empty() && edits.removed.empty()) return out.write(this->bytes());
    for (const Attribute* attribute : edits.added)
      data.append(reinterpret_cast<const char*>(attribute->data.data()), attribute->data.size());
    if (!edits.removed.empty()) data = without(edits.removed, data, edits.added);
    out.write(header(edits));
    write_compressed(data, out);
  }

  // Of data that lies field after field.
  std::string without(std::span<const std::uint8_t> removed, std::string_view data,
                      const AddedAttributes& added) const {
    std::vector<std::size_t> sizes;
    for (const Column& field : header_.fields) sizes.push_back(column_bytes(field));
    for (const Attribute* attribute : added) sizes.push_back(bytes_of({attribute}));
    std::string left;
    for (const std::size_t size : sizes) {
      const std::size_t begin = left.size(), bytes = size * removed.size();
      left += data.substr(0, bytes);
      data.remove_prefix(bytes);
      take_out_records(removed, size, begin, left);
    }
    return left;
  }

  PcdHeader header_;
  std::shared_ptr<const char[]> unpacked_;
};

[[noreturn]] void fail_count(const std::string& name, std::uint64_t promised, const std::string& found) {
  fail(name, "header promises " + std::to_string(promised) + " points, " + found);
}

std::shared_ptr<Source> read_ascii(FileBytes bytes, PcdHeader header, const std::string& name) {
  TextLayout layout;
  layout.begin = header.text.size();
  layout.shape = {RowRule::uncommented, header.line_end, 0};
  layout.rows = find_rows(bytes.view().substr(layout.begin), layout.shape);
  layout.count = header.points();
  layout.exact = true;
  if (const std::uint64_t found = layout.rows.count(); found != layout.count)
    fail_count(name, layout.count,
               found < layout.count
                   ? "file ends after " + std::to_string(found) + "; copy the file again or correct the header"
                   : "file holds " + std::to_string(found) + "; correct the header");
  if (header.record_size() / 8 > bytes.view().size()) fail(name, "COUNT names more values than the file has");
  for (std::size_t f = 0; f < header.fields.size(); ++f) {
    const Column& field = header.fields[f];
    const auto axis = static_cast<std::size_t>(std::ranges::find(header.xyz, f) - header.xyz.begin());
    if (axis < 3) {
      layout.integers = layout.integers || is_integer(field.type);
      layout.doubles = layout.doubles || field.type == NativeType::float64;
    } else if (!is_padding(field)) {
      layout.attributes.push_back({field, layout.columns.size(), true});
    }
    layout.columns.insert(layout.columns.end(), field.components,
                          axis < 3 ? static_cast<ColumnKind>(axis) : ColumnKind::other);
  }
  return std::make_shared<PcdSource<TextSource>>(std::move(header), nullptr, std::move(bytes), name, Format::pcd,
                                                 std::move(layout));
}

RecordLayout record_layout(const PcdHeader& header, bool field_after_field) {
  RecordLayout layout{.begin = header.text.size(),
                      .count = header.points(),
                      .xyz = header.xyz,
                      .record_size = header.record_size(),
                      .swap = kBigEndian};
  std::size_t offset = 0;
  for (const Column& column : header.fields) {
    layout.fields.push_back({column, field_after_field ? offset * static_cast<std::size_t>(layout.count) : offset,
                             field_after_field ? column_bytes(column) : layout.record_size, std::nullopt,
                             is_padding(column)});
    offset += column_bytes(column);
  }
  return layout;
}

std::shared_ptr<Source> read_plain(FileBytes bytes, PcdHeader header, const std::string& name) {
  const std::string_view data = bytes.view().substr(header.text.size());
  const std::size_t record = header.record_size();
  const std::uint64_t room = data.size() / record;
  if (header.points() > room)
    fail_count(name, header.points(),
               "file ends after " + std::to_string(room) + "; copy the file again or correct the header");
  const std::string_view points = data.substr(0, static_cast<std::size_t>(header.points()) * record);
  // Some writers round the size up.
  if (data.substr(points.size()).find_first_not_of(std::string_view("\r\n\0", 3)) != std::string_view::npos)
    fail_count(
        name, header.points(),
        std::to_string(data.size() - points.size()) + " bytes follow the last; correct the header or cut the file");
  RecordLayout layout = record_layout(header, false);
  return std::make_shared<PcdSource<RecordSource>>(std::move(header), nullptr, std::move(bytes), name, Format::pcd,
                                                   Encoding::binary, std::move(layout), points);
}

std::shared_ptr<Source> read_packed(FileBytes bytes, PcdHeader header, const std::string& name) {
  std::string_view data = bytes.view().substr(header.text.size());
  if (data.size() < kSizesBytes) fail(name, "the file ends before its data; copy it again");
  const std::uint64_t packed = load_little<std::uint32_t>(data.data());
  const std::uint64_t size = load_little<std::uint32_t>(data.data() + 4);
  data.remove_prefix(kSizesBytes);
  if (packed > data.size())
    fail(name, "header promises " + std::to_string(packed) + " bytes of compressed data, file ends after " +
                   std::to_string(data.size()) + "; copy it again");
  const std::size_t record = header.record_size();
  if (header.points() != size / record || size % record != 0)
    fail_count(name, header.points(),
               "the compressed data holds " + std::to_string(size / record) + "; correct the header");
  data = data.substr(0, static_cast<std::size_t>(packed));
  std::unique_ptr<char[]> unpacked;
  if (size / kLzfLargestRatio <= packed) unpacked = std::make_unique_for_overwrite<char[]>(size);
  if (!unpacked || !lzf_decompress(data, unpacked.get(), static_cast<std::size_t>(size)))
    fail(name, "the compressed data is damaged; copy the file again");
  const std::string_view points(unpacked.get(), static_cast<std::size_t>(size));
  RecordLayout layout = record_layout(header, true);
  return std::make_shared<PcdSource<RecordSource>>(std::move(header), std::move(unpacked), std::move(bytes), name,
                                                   Format::pcd, Encoding::binary_compressed, std::move(layout), points);
}

// red, green, blue as PCL has them: in the bytes of one number called rgb.
void pack_colors(Table& table) {
  const auto colors = table.find_all(kChannels);
  if (colors.empty()) return;
  TableColumn packed = zero_column({"rgb", NativeType::float32}, table.size());
  for (std::size_t i = 0; i < table.size(); ++i) {
    std::uint32_t value = 0;
    for (const TableColumn* column : colors) value = value << 8 | static_cast<unsigned char>(column->data[i]);
    std::memcpy(packed.data.data() + 4 * i, &value, sizeof value);
  }
  std::erase_if(table.columns,
                [](const TableColumn& c) { return std::ranges::find(kChannels, c.name) != kChannels.end(); });
  for (TableColumn& column : table.columns)
    if (column.name == packed.name) column.name += "_2";
  table.columns.push_back(std::move(packed));
}

// As PCL calls normals.
NewNames pcd_names(const std::vector<std::string>& columns) {
  return new_names(columns, {"x", "y", "z"}, [](const std::string& name) {
    return name == "nx" || name == "ny" || name == "nz" ? "normal_" + name.substr(1) : std::string();
  });
}

}  // namespace

std::vector<std::string> renamed_in_new_pcd(const Cloud& cloud) {
  const std::vector<std::string> names = ply_names(cloud);
  std::vector<std::string> renamed = pcd_names(names).renamed;
  const auto has = [&](std::string_view name) { return std::ranges::find(names, name) != names.end(); };
  if (has("rgb") && std::ranges::all_of(kChannels, has)) renamed.push_back("rgb");  // as in pack_colors
  return renamed;
}

std::shared_ptr<Source> read_pcd(FileBytes bytes, const std::string& name, const Reading&) {
  PcdHeader header = parse_pcd_header(bytes.view(), name);
  const auto read = header.encoding == Encoding::ascii    ? read_ascii
                    : header.encoding == Encoding::binary ? read_plain
                                                          : read_packed;
  return read(std::move(bytes), std::move(header), name);
}

void write_pcd(Table table, const Writing& writing, Output& out) {
  use_ply_names(table);
  pack_colors(table);
  std::vector<TableColumn> columns;
  for (std::size_t axis = 0; axis < 3; ++axis)
    columns.push_back(coordinate_column(table.positions, axis, native(table.coordinate_type)));
  const std::vector<std::string> names = pcd_names(names_of(table)).names;
  for (std::size_t c = 0; c < names.size(); ++c) {
    table.columns[c].name = names[c];
    columns.push_back(std::move(table.columns[c]));
  }
  out.write(new_pcd_header({columns.begin(), columns.end()}, table.size(), 1, PcdHeader().viewpoint, writing.encoding));
  write_data(columns, table.size(), writing.encoding, out);
}

}  // namespace pointfair::io
