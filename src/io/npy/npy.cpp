// SPDX-License-Identifier: Apache-2.0
// Reading and writing NumPy arrays of points: N x 3 and more columns, or records with fields x, y and z.

#include "io/formats.hpp"
#include "io/no_points.hpp"
#include "io/npy/header.hpp"
#include "io/parallel.hpp"
#include "io/record_source.hpp"
#include "io/sensor_source.hpp"
#include "io/text.hpp"

namespace pointfair::io {
namespace npy {
namespace {

// How many axes the points have.
std::size_t axes_of(const Header& header) { return header.shape.size() - (header.is_structured ? 0 : 1); }

class NpySource final : public SensorSource<RecordSource> {
 public:
  NpySource(const Header& header, FileBytes bytes, std::string name, RecordLayout layout, std::string_view points)
      : SensorSource(axes_of(header) == 2 ? header.shape[1] : 0, std::move(bytes), std::move(name), Format::npy,
                     Encoding::binary, std::move(layout), points),
        is_columnar_(header.fortran_order && !header.is_structured),
        shape_(header.shape.begin(), header.shape.begin() + static_cast<std::ptrdiff_t>(axes_of(header))) {
    for (const Field& field : header.fields)
      if (header.is_structured && !field.type && !field.name.empty())
        unread_.push_back({ContentKind::text, "the field " + io::quoted(field.name) + " of a type that is not read"});
  }

  std::vector<Content> contents() const override {
    std::vector<Content> result = RecordSource::contents();
    result.insert(result.end(), unread_.begin(), unread_.end());
    std::string sizes;
    for (const std::uint64_t size : shape_) sizes += (sizes.empty() ? "" : " x ") + std::to_string(size);
    if (shape_.size() > 1) result.push_back({ContentKind::grid, "the grid of " + sizes + " points"});
    return result;
  }

  void write(const Edits& edits, Encoding encoding, Output& out) const override {
    if (!is_columnar_) return Source::write(edits, encoding, out);
    std::string changed(points());  // one column after the other
    for_each_block(block_count(),
                   [&](std::size_t block) { patch(block, moves(block, edits), edits.replaced, changed.data(), 0, 0); });
    out.write(header(edits));
    out.write(changed);
    out.write(tail());
  }

 protected:
  bool may_be_returns() const override { return false; }  // they are numbers, as those of arrays in Python

 private:
  bool is_columnar_;
  std::vector<std::uint64_t> shape_;  // of the points
  std::vector<Content> unread_;       // texts, halves, times, complex numbers
};

// An array of more columns and three or four rows has x in one row, not a point.
constexpr std::uint64_t kMostColumnsOfFewPoints = 64;

// Rows of `columns` values, the coordinates first. A Fortran array has one column after the other.
void lay_out_rows(const Header& header, std::uint64_t columns, RecordLayout& layout, const std::string& name) {
  const Field& field = header.fields[0];
  if (columns < 3 || columns > kMaxColumns)
    fail(name, "is an array with " + std::to_string(columns) + " values a row; points need x, y and z, and at most " +
                   std::to_string(kMaxColumns) + " values. An array of shape (N, 3) or more can be read");
  if ((layout.count == 3 || layout.count == 4) && columns > kMostColumnsOfFewPoints)
    fail(name, "is an array with " + std::to_string(layout.count) + " rows of " + std::to_string(columns) +
                   " values, one axis a row; save its transpose, with a point a row");
  if (!field.type) fail(name, "is not an array of numbers that can be read; convert it with astype('f4')");
  const auto rows = static_cast<std::size_t>(layout.count), values = static_cast<std::size_t>(columns);
  for (std::size_t c = 0; c < values; ++c)
    layout.fields.push_back({{"column_" + std::to_string(c + 1), *field.type},
                             c * field.size * (header.fortran_order ? rows : 1),
                             field.size * (header.fortran_order ? 1 : values)});
  layout.xyz = {0, 1, 2};
  layout.record_size = field.size * values;
  layout.swap = field.big_endian != kBigEndian;
}

// Records; all their numbers must have one byte order.
void lay_out_records(const Header& header, RecordLayout& layout, const std::string& name) {
  std::array<bool, 3> found{};
  std::optional<bool> big_endian;
  for (const Field& field : header.fields) {
    RecordField value{{field.name, field.type.value_or(NativeType::uint8),
                       static_cast<std::uint32_t>(field.type ? field.count : field.size * field.count)},
                      layout.record_size};
    value.padding = !field.type || field.count == 0 || field.name.empty();
    layout.record_size += field.size * field.count;
    if (field.type && field.size > 1) {
      if (big_endian.value_or(field.big_endian) != field.big_endian)
        fail(name, "has fields of both byte orders; save it with one");
      big_endian = field.big_endian;
    }
    const std::string lower = lower_case(field.name);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (lower != std::string(1, "xyz"[axis]) || found[axis] || value.padding || value.components != 1) continue;
      found[axis] = true;
      layout.xyz[axis] = layout.fields.size();
    }
    layout.fields.push_back(std::move(value));
  }
  if (!found[0] || !found[1] || !found[2])
    fail(name, "has records without fields x, y and z of one number each; name the coordinates so");
  if (layout.record_size > 1 << 20) fail(name, "has records of more than a megabyte; leave fields out");
  for (RecordField& field : layout.fields) field.stride = layout.record_size;
  layout.swap = big_endian.value_or(kBigEndian) != kBigEndian;
}

std::uint64_t count_of(const Header& header, std::size_t dimensions, const std::string& name) {
  std::uint64_t count = 1;
  for (std::size_t d = 0; d < dimensions; ++d) {
    count *= header.shape[d];
    if (count >> 40 != 0) fail(name, "has a shape of more values than can be counted; is the header damaged?");
  }
  return count;
}

RecordLayout lay_out(const Header& header, const std::string& name) {
  RecordLayout layout{.begin = header.end};
  const std::size_t dimensions = header.shape.size();
  if (header.is_structured) {
    layout.count = count_of(header, dimensions, name);
    lay_out_records(header, layout, name);
    return layout;
  }
  if (dimensions < 2) fail(name, "is an array of one dimension; an array of shape (N, 3) or more can be read");
  if (header.fortran_order && dimensions > 2)
    fail(name, "is an array of several dimensions in Fortran's order; save numpy.ascontiguousarray of it");
  layout.count = count_of(header, dimensions - 1, name);
  lay_out_rows(header, header.shape.back(), layout, name);
  return layout;
}

}  // namespace
}  // namespace npy

std::shared_ptr<Source> read_npy(FileBytes bytes, const std::string& name, const Reading&) {
  const npy::Header header = npy::parse_header(bytes.view(), name);
  RecordLayout layout = npy::lay_out(header, name);
  if (layout.count == 0) fail_without_points(name);
  const std::uint64_t needed = layout.count * layout.record_size, held = bytes.view().size() - layout.begin;
  if (needed > held)
    fail(name, "header promises " + std::to_string(layout.count) + " points, file ends after " +
                   std::to_string(held / layout.record_size) + "; copy the file again");
  const std::string_view points = bytes.view().substr(layout.begin, static_cast<std::size_t>(needed));
  return std::make_shared<npy::NpySource>(header, std::move(bytes), name, std::move(layout), points);
}

// N x 3 where there is nothing but coordinates, else records.
void write_npy(Table table, const Writing&, Output& out) {
  const NativeType type = native(table.coordinate_type);
  if (table.columns.empty()) {
    out.write(npy::make_header(type, table.size(), 3));
  } else {
    std::vector<npy::Field> fields;
    const auto add = [&](const std::string& name, NativeType its_type, std::uint32_t count) {
      fields.push_back({name, its_type, size_of(its_type), count, kBigEndian});
    };
    for (const char* axis : {"x", "y", "z"}) add(axis, type, 1);
    for (const TableColumn& column : table.columns) add(column.name, column.type, column.components);
    out.write(npy::make_header(fields, table.size()));
  }
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    for (const double value : table.positions[i]) {
      char bytes[8];
      store_double(bytes, type, false, value);
      buffer.append(bytes, size_of(type));
    }
    for (const TableColumn& column : table.columns)
      buffer.append(column.data.data() + i * column_bytes(column), column_bytes(column));
  });
}

// Plain floats, as the data sets KITTI (x, y, z, intensity) and nuScenes (the same, and the ring) have them.
std::shared_ptr<Source> read_floats(FileBytes bytes, const std::string& name, const Reading& reading) {
  class Floats final : public SensorSource<RecordSource> {
   public:
    using SensorSource<RecordSource>::SensorSource;

   protected:
    // Without what was added: nothing in such a file says how many floats a point has.
    void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override {
      const std::size_t begin = record_begin(block_begin(block)), end = record_begin(block_begin(block + 1));
      to.append(points().substr(begin, end - begin));
      patch(block, moves, edits.replaced, to.data(), begin, 0);
    }
  };
  static constexpr std::array<const char*, 5> kNames = {"x", "y", "z", "intensity", "ring"};
  RecordLayout layout;
  for (std::size_t f = 0; f < (reading.format == Format::kitti ? 4U : 5U); ++f)
    layout.fields.push_back({{kNames[f], NativeType::float32}, 4 * f});
  layout.record_size = 4 * layout.fields.size();
  for (RecordField& field : layout.fields) field.stride = layout.record_size;
  layout.xyz = {0, 1, 2};
  layout.swap = kBigEndian;
  const std::string_view points = bytes.view();
  layout.count = points.size() / layout.record_size;
  if (points.size() % layout.record_size != 0 || points.empty())
    fail(name, "is not a whole number of points of " + std::to_string(layout.fields.size()) +
                   " floats; is it the other of kitti and nuscenes, or cut off?");
  return std::make_shared<Floats>(0U, std::move(bytes), name, reading.format, Encoding::binary, std::move(layout),
                                  points);
}

}  // namespace pointfair::io
