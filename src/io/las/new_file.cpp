// SPDX-License-Identifier: Apache-2.0
// A new LAS or LAZ file from a table: LAS 1.4, point format 6, 7 with colours, 8 with near infrared, and what these
// have no place for as extra bytes.
#include <algorithm>
#include <cmath>

#include "io/box_of.hpp"
#include "io/colors.hpp"
#include "io/formats.hpp"
#include "io/intensity.hpp"
#include "io/las/fields.hpp"
#include "io/las/frame.hpp"
#include "io/las/laz.hpp"
#include "io/parallel.hpp"
#include "pointfair/version.hpp"
#include "portable.hpp"

namespace pointfair::io {
namespace las {
namespace {

constexpr std::size_t kHeaderSize = 375;

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorKind::usage, message); }

using Range = BoxOf<double>;

void include(const Position& position, Range& range) {
  if (!std::ranges::all_of(position, [](double value) { return std::isfinite(value); }))
    refuse("a LAS file holds finite coordinates only, and the cloud has others; write PLY or PCD, or remove them");
  range.add(position);
}

Range range_of(const std::vector<Position>& positions) {
  Range range;
  for (const Position& position : positions) include(position, range);
  return range;
}

// Where the integers of an axis count from: a whole number, or where steps are so fine that 32 bits do not reach the
// points from there, a multiple of a hundred million steps near them.
double choose_offset(double min, double max, double scale) {
  constexpr double kReach = std::numeric_limits<std::int32_t>::max();
  const double many = 1e8 * scale;
  for (const double offset : {std::floor(min), std::floor(min / many) * many})
    if ((max - offset) / scale <= kReach && (min - offset) / scale >= -kReach) return offset;
  return min;
}

// A power of ten that divides the extent into 1e8 to 1e9 steps: finer than floats are, and 32 bits hold it.
Scaling choose_scaling(const Range& range, std::optional<double> wanted) {
  if (wanted && !(*wanted > 0 && std::isfinite(*wanted)))
    refuse("the scale cannot be " + listed_numbers({&*wanted, 1}, 10) + ": give a positive length, such as 0.001");
  double extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) extent = std::max(extent, range.max[axis] - range.min[axis]);
  double scale = 0.001;
  if (wanted) {
    scale = *wanted;
  } else if (extent > 0 && std::isfinite(extent)) {
    scale = portable::power_of_ten(portable::decimal_exponent(extent) - 8);
  }
  if (!std::isfinite(extent) || !(scale > 0) || extent / scale > 2e9)
    refuse("the coordinates are too far apart for the scale of a LAS file; give a coarser one, or write PLY or PCD");
  Scaling scaling;
  scaling.scale.fill(scale);
  for (std::size_t axis = 0; axis < 3; ++axis)
    scaling.offset[axis] = choose_offset(range.min[axis], range.max[axis], scale);
  return scaling;
}

// How a column gets into the records.
struct Mapping {
  const TableColumn* column = nullptr;
  std::size_t offset = 0;  // in the record
  NativeType type{};       // there
  unsigned shift = 0, bits = 0;
  double factor = 1;
};

// Whether the field holds all values of the column: as integers where it has these.
bool fits(const TableColumn& column, const Field& field) {
  const double most = field.bits != 0 ? double((1U << field.bits) - 1) : with_type(field.type, [](auto tag) {
    return static_cast<double>(std::numeric_limits<decltype(tag)>::max());
  });
  const double least =
      with_type(field.type, [](auto tag) { return static_cast<double>(std::numeric_limits<decltype(tag)>::lowest()); });
  if (column.components != 1) return false;
  if (field.type == NativeType::float64 && is_integer(column.type) && size_of(column.type) == 8) {
    constexpr double kMost = 9007199254740992;  // 2^53; from there on a double skips integers
    for (std::size_t i = 0; i < column.value_count(); ++i)
      if (!(std::abs(column.value(i)) < kMost)) return false;
    return true;
  }
  if (field.type == NativeType::float64) return size_of(column.type) < 8 || column.type == field.type;
  if (!is_integer(field.type)) return column.type == field.type;
  for (std::size_t i = 0; i < column.value_count(); ++i) {
    const double value = column.value(i);
    if (!(value >= least && value <= most && value == std::nearbyint(value))) return false;
  }
  return true;
}

std::string las_name_of(const TableColumn& column) { return las_name(column.name); }

bool is_color(const std::string& name) { return std::ranges::find(kChannels, name) != kChannels.end(); }

unsigned point_format_for(const Table& table) {
  const bool infrared = std::ranges::find(table.columns, "nir", las_name_of) != table.columns.end();
  return table.find_all(kChannels).empty() ? 6 : infrared ? 8 : 7;
}

Header empty_header(unsigned format) {
  Header header;
  header.point_format = format;
  header.record_length = least_record_length(format);
  return header;
}

// The field that each column goes into, under whose name it is then; none: it becomes extra bytes.
std::vector<const Field*> take_fields(Table& table, const std::vector<Field>& fields) {
  std::vector<const Field*> result;
  for (TableColumn& column : table.columns) {
    const std::string name = las_name_of(column);
    const auto field = std::ranges::find(fields, name, &Field::name);
    const bool known = field != fields.end() && name == column.name;
    const bool is_free = known || !table.find(name);  // and not of another column that is called as here
    const bool is_taken = field != fields.end() && is_free && fits(column, *field);
    if (is_taken) column.name = name;
    result.push_back(is_taken ? &*field : nullptr);
  }
  return result;
}

class NewFile {
 public:
  NewFile(Table& table, bool compress, std::optional<double> scale, Output& out)
      : table_(table), out_(out), range_(range_of(table.positions)), scaling_(choose_scaling(range_, scale)) {
    use_ply_names(table, ColorDepth::sixteen_bits);
    use_las_intensity(table);
    format_ = point_format_for(table);
    record_length_ = least_record_length(format_);
    fields_ = record_fields(empty_header(format_));
    map_columns();
    if (compress) compression_ = usual_compression(format_, record_length_);
  }

  void write() {
    const std::string front = make_front();
    out_.write(front);
    if (compression_) out_.write(std::string(8, '\0'));
    const std::size_t blocks = (table_.size() + kUsualChunk - 1) / kUsualChunk;
    std::vector<std::size_t> sizes(blocks);
    write_blocks(out_, blocks, [&](std::size_t block, std::string& buffer) {
      const std::string records = make_records(block);
      if (compression_) {
        encode_chunk(*compression_, records, buffer);
      } else {
        buffer = records;
      }
      sizes[block] = buffer.size();
    });
    if (compression_) write_table(front.size(), sizes);
  }

 private:
  void map_columns() {
    const std::vector<const Field*> places = take_fields(table_, fields_);
    std::vector<Column> extra;
    for (std::size_t c = 0; c < places.size(); ++c) {
      const TableColumn& column = table_.columns[c];
      if (const Field* const field = places[c]) {
        const double factor = is_color(column.name) && column.type == NativeType::uint8 ? 257 : 1;
        mappings_.push_back({&column, field->offset, field->type, field->shift, field->bits, factor});
        continue;
      }
      mappings_.push_back({&column, record_length_, column.type, 0, 0, 1});
      extra.push_back({column.name, column.type, column.components});
      record_length_ += column_bytes(column);
    }
    if (record_length_ > std::numeric_limits<std::uint16_t>::max())
      refuse("a point of a LAS file holds at most 65535 bytes; write PLY or PCD");
    if (!extra.empty()) descriptions_ = describe_extra_bytes(empty_header(format_), extra);
  }

  Grid grid_of(const Position& position) const {
    Grid grid{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      grid[axis] = narrow<std::int32_t>((position[axis] - scaling_.offset[axis]) / scaling_.scale[axis]);
    return grid;
  }

  std::string make_front() const {
    std::string front("LASF");
    front.resize(kHeaderSize);
    put<std::uint16_t>(front, 6, 16);  // coordinate systems are given as WKT, as formats from 6 on must
    put<std::uint8_t>(front, place::major, 1);
    put<std::uint8_t>(front, place::minor, 4);
    kOwnSystem.copy(front.data() + place::system, 32);
    ("pointfair " + std::string(version())).copy(front.data() + place::software, 32);
    put<std::uint16_t>(front, place::header_size, kHeaderSize);
    put<std::uint8_t>(front, place::point_format, static_cast<std::uint8_t>(format_ | (compression_ ? 0x80 : 0)));
    put<std::uint16_t>(front, place::record_length, static_cast<std::uint16_t>(record_length_));
    const Grid min = grid_of(range_.min), max = grid_of(range_.max);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      put(front, place::scale + 8 * axis, scaling_.scale[axis]);
      put(front, place::offset + 8 * axis, scaling_.offset[axis]);
      put(front, place::bounds + 16 * axis, scaling_.value(axis, max[axis]));
      put(front, place::bounds + 16 * axis + 8, scaling_.value(axis, min[axis]));
    }
    put<std::uint64_t>(front, place::count, table_.size());
    put_return_counts(front);
    std::uint32_t records = 0;
    const auto add = [&](std::string_view user, unsigned id, std::string_view title, const std::string& data) {
      front += make_record(user, id, title, data);
      ++records;
    };
    if (!descriptions_.empty()) add("LASF_Spec", 4, "extra bytes", descriptions_);
    if (compression_) add(kLaszipUser, kLaszipId, "by LASzip of pointfair", compression_record(*compression_));
    put(front, place::record_count, records);
    put(front, place::points_begin, static_cast<std::uint32_t>(front.size()));
    return front;
  }

  const Mapping* find(std::string_view name) const {
    const auto found = std::ranges::find_if(mappings_, [&](const Mapping& mapping) {
      return mapping.column->name == name && mapping.offset < least_record_length(format_);
    });
    return found == mappings_.end() ? nullptr : &*found;
  }

  void put_return_counts(std::string& front) const {
    std::array<std::uint64_t, 16> counts{};
    const Mapping* const number = find("return_number");
    if (!number) counts[1] = table_.size();
    for (std::size_t i = 0; number && i < table_.size(); ++i)
      ++counts[static_cast<std::size_t>(number->column->value(i))];
    for (std::size_t r = 1; r < counts.size(); ++r) put(front, place::returns + 8 * (r - 1), counts[r]);
  }

  std::string make_records(std::size_t block) const {
    const std::size_t first = block * kUsualChunk, last = std::min<std::size_t>(first + kUsualChunk, table_.size());
    std::string records((last - first) * record_length_, '\0');
    char numbers = 0;  // of returns, where the cloud does not say: the only one
    if (!find("return_number")) numbers |= 1;
    if (!find("number_of_returns")) numbers |= 1 << 4;
    for (std::size_t i = first; i < last; ++i) {
      const std::size_t at = (i - first) * record_length_;
      put_grid(grid_of(table_.positions[i]), records.data() + at);
      records[at + 14] = numbers;
      for (const Mapping& mapping : mappings_) put_value(mapping, i, records.data() + at + mapping.offset);
    }
    return records;
  }

  static void put_value(const Mapping& mapping, std::size_t point, char* to) {
    const std::size_t size = size_of(mapping.column->type), bytes = column_bytes(*mapping.column);
    const char* from = mapping.column->data.data() + point * bytes;
    if (mapping.bits != 0) {
      const auto value = static_cast<unsigned>(load_double(from, mapping.column->type, false));
      *to = static_cast<char>(*to | static_cast<char>(value << mapping.shift));
    } else if (mapping.type == mapping.column->type) {
      for (std::size_t c = 0; c < bytes; c += size) copy_scalar(to + c, from + c, size, kBigEndian);
    } else {
      store_double(to, mapping.type, kBigEndian, mapping.factor * load_double(from, mapping.column->type, false));
    }
  }

  void write_table(std::size_t chunks_place, const std::vector<std::size_t>& sizes) {
    std::uint64_t at = chunks_place + 8;
    for (const std::size_t size : sizes) at += size;
    std::string place;
    append_little(place, at);
    out_.write(chunk_table(*compression_, sizes, {}));
    out_.patch(chunks_place, place);
  }

  Table& table_;
  Output& out_;
  Range range_;
  Scaling scaling_;
  unsigned format_ = 6;
  std::size_t record_length_ = 0;
  std::vector<Field> fields_;
  std::vector<Mapping> mappings_;
  std::string descriptions_;  // of extra bytes
  std::optional<Compression> compression_;
};

}  // namespace
}  // namespace las

void check_new_las(const Cloud& cloud, std::optional<double> scale) {
  try {
    las::choose_scaling(las::range_of(written_positions(cloud)), scale);
  } catch (const Error& error) {
    if (!cloud.source) throw;
    throw Error(error.kind(), cloud.source->name() + ": " + error.what());
  }
}

std::vector<std::string> renamed_in_new_las(const Cloud& cloud) {
  const std::vector<las::Field> all = las::record_fields(las::empty_header(8));  // all that new files have
  Table table;  // with the values of columns that may not fit
  for (const AttributeInfo& info : attributes(cloud)) {
    const std::string name = las_name(info.name);
    const bool is_scaled = las::is_color(name) || lower_case(info.name) == "intensity";
    const bool may_fit =
        info.components == 1 && !is_scaled && std::ranges::find(all, name, &las::Field::name) != all.end();
    table.columns.push_back(may_fit ? column_of(attribute(cloud, info.name))
                                    : TableColumn{{info.name, native(info.type), info.components}, {}});
  }
  use_ply_names(table, ColorDepth::sixteen_bits);
  use_las_intensity(table);
  const las::Header header = las::empty_header(las::point_format_for(table));
  const std::vector<las::Field> fields = las::record_fields(header);
  const std::vector<const las::Field*> places = las::take_fields(table, fields);
  std::vector<Column> extra;
  for (std::size_t c = 0; c < places.size(); ++c)
    if (!places[c]) extra.push_back({table.columns[c].name, table.columns[c].type, 1});
  const std::vector<std::string> names = las::extra_names(header, extra);
  std::vector<std::string> renamed;
  for (std::size_t c = 0; c < names.size(); ++c)
    if (names[c] != extra[c].name) renamed.push_back(extra[c].name);
  return renamed;
}

void write_las(Table table, const Writing& writing, Output& out) {
  const bool compress = writing.encoding == Encoding::binary_compressed;
  write_patched(out, [&](Output& to) { las::NewFile(table, compress, writing.las_scale, to).write(); });
}

}  // namespace pointfair::io
