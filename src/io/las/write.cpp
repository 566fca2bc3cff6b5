// SPDX-License-Identifier: Apache-2.0
// Writing a LAS or LAZ file back with moved points, or without some of them.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "io/file_bytes.hpp"
#include "io/las/frame.hpp"
#include "io/las/source.hpp"
#include "io/parallel.hpp"
#include "io/record_source.hpp"

namespace pointfair::io::las {
namespace {

// The integer that is nearest to where a coordinate went; its own if no integer holds that.
std::int32_t moved_integer(std::int32_t own, double shift, double scale) {
  const double now = own + std::nearbyint(shift / scale);
  const bool fits = now >= std::numeric_limits<std::int32_t>::min() && now <= std::numeric_limits<std::int32_t>::max();
  return fits ? static_cast<std::int32_t>(now) : own;
}

std::string text_of(double number) {
  char text[32];
  return {text, static_cast<std::size_t>(std::snprintf(text, sizeof text, "%.10g", number))};
}

[[noreturn]] void refuse_fine_scale(double scale) {
  throw Error(ErrorKind::usage,
              "the coordinates do not fit in 32 bits with a scale of " + text_of(scale) + "; give a coarser one");
}

// How many steps of the scale that is asked for make one of the file's own, on each axis.
Grid steps_of(const Scaling& own, std::optional<double> wanted) {
  Grid steps{1, 1, 1};
  for (std::size_t axis = 0; wanted && axis < 3; ++axis) {
    constexpr double kMost = 1e6;  // beyond, few files have coordinates that fit in 32 bits
    const double ratio = own.scale[axis] / *wanted, whole = std::nearbyint(ratio);
    if (*wanted > 0 && whole >= kMost)
      throw Error(ErrorKind::usage, "the scale cannot be " + text_of(*wanted) +
                                        ": it must be less than a million times finer than the file's own, " +
                                        text_of(own.scale[axis]) + "; give a coarser one");
    if (!(whole >= 1 && whole < kMost) || std::abs(ratio - whole) > 1e-6 * whole)
      throw Error(ErrorKind::usage, "the scale cannot be " + text_of(*wanted) + ": give the file's own, " +
                                        text_of(own.scale[axis]) + ", divided by a whole number, such as " +
                                        text_of(own.scale[axis] / 10));
    steps[axis] = static_cast<std::int32_t>(whole);
  }
  return steps;
}

// Puts other values into a field of the records of points from `first` on.
void replace_field(const Field& field, const Replacement& replacement, std::uint64_t first, std::size_t record_length,
                   std::string& records) {
  const std::size_t size = size_of(field.stored);
  const auto mask = static_cast<unsigned char>(((1U << field.bits) - 1) << field.shift);
  for (std::size_t i = 0; i * record_length < records.size(); ++i) {
    char* to = records.data() + i * record_length + field.offset;
    for (std::uint32_t c = 0; c < field.components; ++c, to += size) {
      const double value = replacement.value(first + i, c);
      if (field.bits != 0) {
        const auto bits = static_cast<unsigned>(narrow<std::uint8_t>(value)) << field.shift;
        *to = static_cast<char>((static_cast<unsigned char>(*to) & ~mask) | (bits & mask));
      } else {
        store_double(to, field.stored, kBigEndian, field.scaled ? (value - field.add[c]) / field.scale[c] : value);
      }
    }
  }
}

}  // namespace

class LasWriter {
 public:
  LasWriter(const LasSource& source, const Edits& edits, bool compress, Output& out)
      : source_(source),
        layout_(source.layout_),
        edits_(edits),
        out_(out),
        frame_(source.bytes(), layout_.header, layout_.points_end, source.name()),
        record_length_(layout_.header.record_length),
        steps_(steps_of(layout_.header.scaling, edits.las_scale)),
        scaling_(layout_.header.scaling),
        removes_(std::ranges::any_of(edits.removed, [](std::uint8_t gone) { return gone != 0; })) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (steps_[axis] > 1) scaling_.scale[axis] = *edits.las_scale;
    add_attributes();
    if (compress) choose_compression();
    if (!compress && layout_.compression) drop(kLaszipUser, kLaszipId);
    if (compress && (!has_chunks() || !edits.added.empty() || removes_))
      frame_.put_record(kLaszipUser, kLaszipId, "by LASzip of pointfair", compression_record(*compression_));
    if (compress || layout_.compression) {
      drop("copc", 1);  // an octree of compressed points, which no longer are where it has them
      drop("copc", 1000);
    }
  }

  void write() {
    if (compression_ && layout_.compression && !has_chunks() && changes_nothing()) return out_.write(file());
    std::string front = frame_.front(compression_.has_value(), record_length_);
    for (std::size_t axis = 0; axis < 3; ++axis) put(front, place::scale + 8 * axis, scaling_.scale[axis]);
    out_.write(front);
    const std::string_view own_place = file().substr(layout_.header.points_begin, kPlaceBytes);
    if (compression_) out_.write(has_chunks() ? own_place : std::string_view("\0\0\0\0\0\0\0\0", kPlaceBytes));
    write_points();
    std::uint64_t end = front.size() + (compression_ ? kPlaceBytes : 0);
    for (const Block& block : blocks_) end += block.size;
    if (is_copy()) return out_.write(file().substr(layout_.chunks_end));
    if (compression_) end = write_table(front.size(), end);
    for (const std::string_view piece : frame_.tail()) out_.write(piece);
    put_counts(front);
    put_all_bounds(front);
    frame_.place_tail(front, end);
    out_.patch(0, std::string_view(front).substr(0, layout_.header.size));
  }

 private:
  static constexpr std::size_t kPlaceBytes = 8;  // before the chunks: where their table is

  // What becomes of one.
  struct Block {
    std::size_t size = 0;    // as written
    std::uint32_t left = 0;  // points
    ReturnCounts gone{};
    GridBounds before, now;
    bool kept = false, moved = false;  // its chunk is copied; coordinates in it change
  };

  std::string_view file() const { return source_.bytes(); }

  // With a table, so that they can be copied.
  bool has_chunks() const { return layout_.compression && !layout_.compression->pointwise; }

  bool changes_nothing() const {
    if (edits_.changes_attributes() || is_refined() || removes_) return false;
    for (std::size_t block = 0; block < source_.block_count(); ++block)
      if (!source_.moves(block, edits_).are_none()) return false;
    return true;
  }

  void drop(std::string_view user, unsigned id) {
    if (const Record* const record = layout_.header.find(user, id)) frame_.drop(*record);
  }

  void add_attributes() {
    if (edits_.added.empty()) return;
    std::vector<Column> columns;
    for (const Attribute* attribute : edits_.added) {
      columns.push_back({attribute->name, native(attribute->type), attribute->components});
      record_length_ += column_bytes(columns.back());
    }
    if (record_length_ > std::numeric_limits<std::uint16_t>::max())
      fail(source_.name(), "a point of a LAS file holds at most 65535 bytes; add fewer attributes");
    const Record* const described = layout_.header.find("LASF_Spec", 4);
    if (described && described->extended) frame_.drop(*described);
    frame_.put_record("LASF_Spec", 4, "extra bytes", describe_extra_bytes(layout_.header, columns));
  }

  void choose_compression() {
    compression_ = usual_compression(layout_.header.point_format, record_length_);
    if (has_chunks()) {
      compression_->chunk_points = layout_.compression->chunk_points;
      compression_->set_version(layout_.compression->version());
    }
    if (removes_) compression_->chunk_points = 0;  // so that the other chunks stay as they are
  }

  void write_points() {
    blocks_.resize(source_.block_count());
    write_blocks(out_, blocks_.size(), [&](std::size_t block, std::string& buffer) {
      append_block(block, buffer);
      blocks_[block].size = buffer.size();
    });
  }

  void append_block(std::size_t block, std::string& buffer) {
    Block& its = blocks_[block];
    thread_local std::vector<Grid> grid;  // its memory serves the thread's next block
    thread_local Decoded decoded;         // that of another store's block of this number must not be taken for ours
    decoded.block.reset();
    grid.resize(source_.block_size(block));
    source_.store_->grid(block, grid, decoded);
    for (Grid& point : grid) {
      refine(point);
      its.before.add(point);
    }
    its.moved = move(block, grid) || is_refined();
    its.left = static_cast<std::uint32_t>(grid.size());
    if (loses_points(block)) return append_remaining(block, grid, decoded, buffer);
    for (const Grid& point : grid) its.now.add(point);
    if (compression_ && !edits_.changes_attributes()) {
      const std::string_view own = source_.store_->chunk(block);
      its.kept = !its.moved && !own.empty();
      if (its.kept) {
        buffer.append(own);
        return;
      }
      buffer.reserve(own.size() + own.size() / 8);
      if (source_.store_->append_moved_chunk(block, grid, decoded, buffer)) return;
    }
    append_coded(make_records(block, grid, decoded), buffer);
  }

  bool loses_points(std::size_t block) const {
    if (!removes_) return false;
    const auto its = edits_.removed.subspan(static_cast<std::size_t>(source_.block_begin(block)), blocks_[block].left);
    return std::ranges::any_of(its, [](std::uint8_t gone) { return gone != 0; });
  }

  void append_remaining(std::size_t block, const std::vector<Grid>& grid, Decoded& decoded, std::string& buffer) {
    Block& its = blocks_[block];
    std::string& points = make_records(block, grid, decoded);
    const auto number = std::ranges::find(source_.fields_, "return_number", &Field::name);
    std::vector<std::uint8_t> numbers(grid.size());
    extract_field(*number, points.data(), record_length_, grid.size(), reinterpret_cast<char*>(numbers.data()));
    const std::size_t first = static_cast<std::size_t>(source_.block_begin(block));
    char* to = points.data();
    for (std::size_t i = 0; i < grid.size(); ++i) {
      if (edits_.removed[first + i] != 0) {
        ++its.gone[numbers[i] % its.gone.size()];
        continue;
      }
      its.now.add(grid[i]);
      std::copy_n(points.data() + i * record_length_, record_length_, to);
      to += record_length_;
    }
    points.resize(static_cast<std::size_t>(to - points.data()));
    its.left = static_cast<std::uint32_t>(points.size() / record_length_);
    if (!points.empty()) append_coded(points, buffer);
  }

  bool is_refined() const { return steps_ != Grid{1, 1, 1}; }

  // The same place in steps of the new scale.
  void refine(Grid& point) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int64_t fine = std::int64_t{point[axis]} * steps_[axis];
      if (fine != static_cast<std::int32_t>(fine)) refuse_fine_scale(scaling_.scale[axis]);
      point[axis] = static_cast<std::int32_t>(fine);
    }
  }

  // Moves the points of the block; false if none did.
  bool move(std::size_t block, std::span<Grid> grid) const {
    constexpr std::size_t kPiece = 2048;  // points; what is made for them stays in the cache
    bool moved = false;
    for (std::size_t first = 0; first < grid.size(); first += kPiece) {
      const std::span<Grid> piece = grid.subspan(first, std::min(kPiece, grid.size() - first));
      moved = move_piece(source_.block_begin(block) + first, piece) || moved;
    }
    return moved;
  }

  // The same for points from `first` on.
  bool move_piece(std::uint64_t first, std::span<Grid> grid) const {
    const auto own = [&](std::size_t i, std::size_t axis) {
      return layout_.header.scaling.value(axis, grid[i][axis] / steps_[axis]);
    };
    std::vector<Position> positions(grid.size());
    for (std::size_t i = 0; i < grid.size(); ++i) positions[i] = {own(i, 0), own(i, 1), own(i, 2)};
    const Moves moves = source_.moves(first, std::move(positions), edits_);
    bool moved = false;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if ((moves.changed[i] >> axis & 1) == 0) continue;
        const double shift = moves.values[i][axis] - own(i, axis);
        const std::int32_t now = moved_integer(grid[i][axis], shift, scaling_.scale[axis]);
        if (edits_.placed && now == grid[i][axis] && std::abs(shift) > scaling_.scale[axis])
          fail(source_.name(),
               "its scale and offset have no integers for the positions that were given; write PLY, or a new cloud of "
               "these positions");
        moved = moved || now != grid[i][axis];
        grid[i][axis] = now;
      }
    }
    return moved;
  }

  // The records as they will be, but for those that are removed. They are the thread's until its next block.
  std::string& make_records(std::size_t block, const std::vector<Grid>& grid, Decoded& decoded) const {
    thread_local std::string points;
    points.clear();
    const std::string_view own = source_.store_->records(block, {0, layout_.header.record_length}, decoded);
    if (edits_.added.empty()) {
      points = own;
    } else {
      const std::size_t length = layout_.header.record_length;
      points.reserve(grid.size() * record_length_);
      for (std::size_t i = 0; i < grid.size(); ++i) {
        points.append(own.substr(i * length, length));
        append_added(edits_.added, source_.block_begin(block) + i, kBigEndian, points);
      }
    }
    for (std::size_t i = 0; blocks_[block].moved && i < grid.size(); ++i)
      put_grid(grid[i], points.data() + i * record_length_);
    for (const Replacement& replacement : edits_.replaced)
      replace_field(source_.fields_[replacement.column], replacement, source_.block_begin(block), record_length_,
                    points);
    return points;
  }

  void append_coded(std::string& points, std::string& buffer) const {
    if (compression_) {
      encode_chunk(*compression_, points, buffer);
    } else {
      buffer = std::move(points);
    }
  }

  // All chunks are as they were, and nothing else changes.
  bool is_copy() const {
    return compression_ && !edits_.changes_attributes() && !is_refined() && !removes_ && !layout_.is_copc() &&
           std::ranges::all_of(blocks_, &Block::kept);
  }

  // Returns where the table ends in the output.
  std::uint64_t write_table(std::uint64_t chunks_place, std::uint64_t chunks_end) {
    const std::string_view gap = file().substr(layout_.chunks_end, layout_.table_begin - layout_.chunks_end);
    out_.write(gap);
    std::vector<std::size_t> sizes;
    std::vector<std::uint32_t> points;
    for (const Block& block : blocks_) {
      if (block.left == 0) continue;
      sizes.push_back(block.size);
      points.push_back(block.left);
    }
    const std::string table = chunk_table(*compression_, sizes, points);
    out_.write(table);
    std::string place;
    append_little<std::uint64_t>(place, chunks_end + gap.size());
    out_.patch(chunks_place, place);
    return chunks_end + gap.size() + table.size();
  }

  void put_counts(std::string& front) const {
    if (!removes_) return;
    ReturnCounts gone{};
    std::uint64_t left = 0;
    for (const Block& block : blocks_) {
      left += block.left;
      for (std::size_t r = 0; r < gone.size(); ++r) gone[r] += block.gone[r];
    }
    if (left == 0)
      fail(source_.name(), "none of its points would be left; leave out this file, or remove fewer points");
    take_off_counts(gone, layout_.header.count - left, layout_.header, front);
  }

  // Where no coordinate changes, wrong bounds are not this writer's to repair.
  void put_all_bounds(std::string& front) const {
    if (!removes_ && std::ranges::none_of(blocks_, &Block::moved)) return;
    GridBounds before, now;
    for (const Block& block : blocks_) {
      before.add(block.before);
      now.add(block.now);
    }
    put_bounds(scaling_, before, now, front);
  }

  const LasSource& source_;
  const Layout& layout_;
  const Edits& edits_;
  Output& out_;
  Frame frame_;
  std::size_t record_length_;               // as written
  Grid steps_;                              // as written, of a step of the file's own scale
  Scaling scaling_;                         // as written
  bool removes_;                            // some points are left out
  std::optional<Compression> compression_;  // as written; none: uncompressed
  std::vector<Block> blocks_;
};

// By the bounds in the header; those of the points decide when they are written.
void LasSource::check_las_scale(double scale) const {
  const Scaling& own = layout_.header.scaling;
  const Grid steps = steps_of(own, scale);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const std::size_t side : {0, 8}) {
      const auto bound = get<double>(bytes(), place::bounds + 16 * axis + side);
      const double fine = (bound - own.offset[axis]) / own.scale[axis] * steps[axis];
      if (steps[axis] > 1 && std::abs(fine) > std::numeric_limits<std::int32_t>::max()) refuse_fine_scale(scale);
    }
  }
}

void LasSource::write(const Edits& edits, Encoding encoding, Output& out) const {
  write_patched(out, [&](Output& to) { LasWriter(*this, edits, encoding == Encoding::binary_compressed, to).write(); });
}

}  // namespace pointfair::io::las
