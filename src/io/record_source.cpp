// SPDX-License-Identifier: Apache-2.0
#include "io/record_source.hpp"

#include <algorithm>
#include <cstring>

#include "io/coordinate_names.hpp"

namespace pointfair::io {
namespace {

constexpr std::uint64_t kBlock = 4096;

// Of a field in a record that was walked along before.
std::size_t bytes_of(const RecordField& field, const char* at, bool swap) {
  if (!field.list_count) return column_bytes(field);
  return size_of(*field.list_count) +
         static_cast<std::size_t>(load_double(at, *field.list_count, swap)) * size_of(field.type);
}

}  // namespace

void append_added(const AddedAttributes& added, std::uint64_t point, bool swap, std::string& to) {
  for_each_value(added, point, [&](const char* value, NativeType type) {
    char scalar[8];
    copy_scalar(scalar, value, size_of(type), swap);
    to.append(scalar, size_of(type));
  });
}

void take_out_records(std::span<const std::uint8_t> removed, std::size_t size, std::size_t begin, std::string& data) {
  char* to = data.data() + begin;
  const char* from = to;
  for (const std::uint8_t is_removed : removed) {
    if (is_removed == 0) {
      std::memmove(to, from, size);
      to += size;
    }
    from += size;
  }
  data.resize(static_cast<std::size_t>(to - data.data()));
}

RecordSource::RecordSource(FileBytes bytes, std::string name, Format format, Encoding encoding, RecordLayout layout,
                           std::string_view points)
    : Source(std::move(bytes), std::move(name), format, encoding), layout_(std::move(layout)), points_(points) {
  for (std::size_t f = 0; f < layout_.fields.size(); ++f) {
    const bool coordinate = std::ranges::find(layout_.xyz, f) != layout_.xyz.end();
    if (!coordinate && !layout_.fields[f].padding && !layout_.fields[f].list_count) shown_.push_back(f);
  }
  std::vector<std::string> names = {"x", "y", "z"};
  for (const std::size_t f : shown_) names.push_back(layout_.fields[f].name);
  make_distinct(names);
  for (std::size_t a = 0; a < shown_.size(); ++a) layout_.fields[shown_[a]].name = names[3 + a];
}

std::size_t RecordSource::block_count() const {
  return static_cast<std::size_t>((layout_.count + kBlock - 1) / kBlock);
}

std::uint64_t RecordSource::block_begin(std::size_t block) const { return std::min(block * kBlock, layout_.count); }

std::size_t RecordSource::record_begin(std::uint64_t point) const {
  return static_cast<std::size_t>(layout_.starts.empty() ? point * layout_.record_size : layout_.starts[point]);
}

std::size_t RecordSource::locate(std::uint64_t point, std::size_t field) const {
  if (layout_.starts.empty())
    return layout_.fields[field].offset + static_cast<std::size_t>(point) * layout_.fields[field].stride;
  std::size_t at = record_begin(point);
  for (std::size_t f = 0; f < field; ++f) at += bytes_of(layout_.fields[f], points_.data() + at, layout_.swap);
  return at;
}

void RecordSource::positions(std::size_t block, std::span<Position> out) const {
  const std::uint64_t first = block_begin(block);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t f = layout_.xyz[axis];
    const RecordField& field = layout_.fields[f];
    if (!layout_.starts.empty()) {
      for (std::size_t i = 0; i < out.size(); ++i)
        out[i][axis] = load_double(points_.data() + locate(first + i, f), field.type, layout_.swap);
      continue;
    }
    const char* const from = points_.data() + locate(first, f);
    const std::size_t stride = field.stride;
    const auto read = [&](auto tag, auto swap) {
      for (std::size_t i = 0; i < out.size(); ++i)
        out[i][axis] = static_cast<double>(load<decltype(tag)>(from + i * stride, swap));
    };
    with_type(field.type, [&](auto tag) { layout_.swap ? read(tag, std::true_type{}) : read(tag, std::false_type{}); });
  }
}

// Three floats in a row, as in most files.
bool RecordSource::copy_points(std::size_t block, std::span<Point> out) const {
  const auto& [x, y, z] = layout_.xyz;
  const auto follows = [&](std::size_t f, std::size_t before) {
    return layout_.fields[f].type == NativeType::float32 && layout_.fields[f].stride == layout_.record_size &&
           layout_.fields[f].offset == layout_.fields[before].offset + sizeof(float);
  };
  const bool floats = layout_.fields[x].type == NativeType::float32 && follows(y, x) && follows(z, y);
  if (!floats || !layout_.starts.empty() || layout_.swap) return false;
  const char* from = points_.data() + locate(block_begin(block), x);
  for (Point& point : out) {
    std::memcpy(&point, from, sizeof point);
    from += layout_.record_size;
  }
  return true;
}

ScalarType RecordSource::coordinate_type() const {
  // 32-bit integers have more digits than a float holds.
  const auto needs_double = [&](std::size_t f) {
    const NativeType type = layout_.fields[f].type;
    return type != NativeType::float32 && size_of(type) >= 4;
  };
  return std::ranges::any_of(layout_.xyz, needs_double) ? ScalarType::float64 : ScalarType::float32;
}

FileInfo RecordSource::info() const {
  FileInfo result;
  if (std::ranges::any_of(layout_.xyz, [&](std::size_t f) { return is_integer(layout_.fields[f].type); }))
    result.step = 1;
  return result;
}

std::vector<Column> RecordSource::columns() const {
  std::vector<Column> result;
  for (const std::size_t f : shown_) result.push_back(layout_.fields[f]);
  return result;
}

void RecordSource::extract_block(std::size_t index, std::size_t block, std::span<char> out) const {
  const std::size_t f = shown_[index];
  const RecordField& field = layout_.fields[f];
  const std::size_t size = size_of(field.type);
  char* to = out.data();
  for (std::uint64_t point = block_begin(block); point < block_begin(block + 1); ++point) {
    const char* from = points_.data() + locate(point, f);
    for (std::uint32_t c = 0; c < field.components; ++c, to += size)
      copy_scalar(to, from + c * size, size, layout_.swap);
  }
}

void RecordSource::patch(std::size_t block, const Moves& moves, const std::vector<Replacement>& replaced, char* to,
                         std::size_t base, std::size_t extra_per_point) const {
  const std::uint64_t first = block_begin(block);
  for (const Replacement& replacement : replaced) {
    const std::size_t f = shown_[replacement.column];
    const RecordField& field = layout_.fields[f];
    for (std::size_t i = 0; i < moves.changed.size(); ++i) {
      char* at = to + (locate(first + i, f) - base) + i * extra_per_point;
      for (std::uint32_t c = 0; c < field.components; ++c, at += size_of(field.type))
        store_double(at, field.type, layout_.swap, replacement.value(first + i, c));
    }
  }
  for (std::size_t i = 0; i < moves.changed.size(); ++i) {
    if (moves.changed[i] == 0) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if ((moves.changed[i] >> axis & 1) == 0) continue;
      const std::size_t field = layout_.xyz[axis];
      char* const at = to + (locate(first + i, field) - base) + i * extra_per_point;
      store_double(at, layout_.fields[field].type, layout_.swap, moves.values[i][axis]);
    }
  }
}

const Replacement* RecordSource::find_replacement(const std::vector<Replacement>& replaced, std::size_t field) const {
  const auto found = std::ranges::find_if(
      replaced, [&](const Replacement& replacement) { return shown_[replacement.column] == field; });
  return found == replaced.end() ? nullptr : &*found;
}

void RecordSource::append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const {
  const AddedAttributes& added = edits.added;
  const std::uint64_t first = block_begin(block), last = block_begin(block + 1);
  if (added.empty()) {
    to.append(points_.substr(record_begin(first), record_begin(last) - record_begin(first)));
  } else {
    for (std::uint64_t point = first; point < last; ++point) {
      to.append(points_.substr(record_begin(point), record_begin(point + 1) - record_begin(point)));
      append_added(added, point, layout_.swap, to);
    }
  }
  patch(block, moves, edits.replaced, to.data(), record_begin(first), bytes_of(added));
}

void RecordSource::take_out(std::span<const std::uint8_t> removed, const Edits& edits, std::string& records) const {
  take_out_records(removed, layout_.record_size + bytes_of(edits.added), 0, records);
}

}  // namespace pointfair::io
