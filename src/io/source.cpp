// SPDX-License-Identifier: Apache-2.0
#include "io/source.hpp"

#include <algorithm>

#include "io/offset.hpp"
#include "io/parallel.hpp"
#include "io/placed_source.hpp"
#include "io/text.hpp"
#include "platform/large_pages.hpp"
#include "platform/path_text.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kSampledBlocks = 32, kSampledPerBlock = 128;

// Zeroed points.
std::vector<Point> new_points(std::size_t count) {
  std::vector<Point> points;
  points.reserve(count);
  platform::prefer_large_pages(points.data(), count * sizeof(Point));
  points.resize(count);
  return points;
}

using io::same_bits;
using io::to_offset;

// What look(block, sample) offers of each block of the file, many at once.
template <class Look>
std::vector<Position> sample_of(const Source& source, const Look& look) {
  std::vector<io::OriginSample> of_block(source.block_count(), io::OriginSample(source.size()));
  io::for_each_block(source.block_count(), [&](std::size_t block) { look(block, of_block[block]); });
  io::OriginSample all(source.size());
  for (const io::OriginSample& sample : of_block) all.offer_all(sample);
  return std::move(all).take();
}

}  // namespace

std::vector<Position> Source::some_positions() const {
  std::vector<Position> rows;
  const std::size_t blocks = block_count(), block_step = std::max<std::size_t>(1, blocks / kSampledBlocks);
  for (std::size_t block = 0; block < blocks; block += block_step) {
    std::vector<Position> values(block_size(block));
    positions(block, values);
    const std::size_t step = std::max<std::size_t>(1, values.size() / kSampledPerBlock);
    for (std::size_t i = 0; i < values.size(); i += step) rows.push_back(values[i]);
  }
  return rows;
}

// A guess saves a second pass: it is nearly always what the sample shows. Of a damaged file, it might name another
// place than the first one.
std::vector<Point> Source::place() {
  try {
    origin_ = io::choose_origin(some_positions());
  } catch (const Error&) {
    origin_ = {};
  }
  std::vector<Point> points = new_points(static_cast<std::size_t>(size()));
  sample_ = place_at_origin(points);
  const Position origin = io::choose_origin(sample_);
  if (origin != origin_) {
    origin_ = origin;
    place_at_origin(points);
  }
  return points;
}

// Others write digits, whole numbers, or offsets from a place.
bool Source::stores_floats() const {
  constexpr Format kOfNumbers[] = {Format::ply, Format::pcd, Format::npy, Format::stl};
  return std::ranges::find(kOfNumbers, format()) != std::end(kOfNumbers) && coordinate_type() == ScalarType::float32;
}

Position Source::sampled_origin() const {
  return io::choose_origin(sample_of(*this, [&](std::size_t block, io::OriginSample& sample) {
    thread_local std::vector<Position> values;
    values.resize(block_size(block));
    positions(block, values);
    for (const Position& value : values) sample.offer(value);
  }));
}

std::vector<Position> Source::place_at_origin(std::span<Point> points) const {
  return sample_of(*this, [&](std::size_t block, io::OriginSample& sample) {
    place_block(block, points.subspan(static_cast<std::size_t>(block_begin(block)), block_size(block)), sample);
  });
}

void Source::place_block(std::size_t block, std::span<Point> points, io::OriginSample& sample) const {
  if (origin_ == Position{} && copy_points(block, points)) {
    for (const Point& p : points) sample.offer({p.x, p.y, p.z});
    return;
  }
  thread_local std::vector<Position> values;
  values.resize(points.size());
  positions(block, values);
  for (std::size_t i = 0; i < points.size(); ++i) {
    sample.offer(values[i]);
    points[i] = offset_of(values[i], origin_);
  }
}

Point Source::offset_of(const Position& value, const Position& origin) {
  return {to_offset(value[0], origin[0]), to_offset(value[1], origin[1]), to_offset(value[2], origin[2])};
}

void Source::fail_at(const char* place, const std::string& message) const {
  io::fail(name_, "line " + std::to_string(io::line_number(bytes(), place)) + ": " + message);
}

void Source::extract(std::size_t index, std::span<char> out) const {
  std::vector<std::span<char>> places(columns().size());
  places[index] = out;
  extract_several(places);
}

void Source::extract_several(std::span<const std::span<char>> out) const {
  if (std::ranges::all_of(out, [](std::span<char> place) { return place.empty(); })) return;
  const std::vector<io::Column> all = columns();
  io::for_each_block(block_count(), [&](std::size_t block) {
    std::vector<std::span<char>> of_block;
    for (std::size_t c = 0; c < all.size(); ++c) {
      const std::size_t size = io::column_bytes(all[c]), begin = static_cast<std::size_t>(block_begin(block)) * size;
      of_block.push_back(out[c].empty() ? out[c] : out[c].subspan(begin, block_size(block) * size));
    }
    extract_several_of_block(block, of_block);
  });
}

void Source::extract_several_of_block(std::size_t block, std::span<const std::span<char>> out) const {
  for (std::size_t c = 0; c < out.size(); ++c)
    if (!out[c].empty()) extract_block(c, block, out[c]);
}

io::FaceSummary Source::face_summary() const {
  io::FaceCounter counter;
  visit_faces(counter);
  return counter.finish();
}

Faces Source::faces() const {
  io::FaceCollector collector(true);
  visit_faces(collector);
  return std::move(collector).finish();
}

Moves Source::moves(std::size_t block, const io::Edits& edits) const {
  std::vector<Position> own(block_size(block));
  positions(block, own);
  return moves(block_begin(block), std::move(own), edits);
}

Moves Source::moves(std::uint64_t first, std::vector<Position> own, const io::Edits& edits) const {
  if (edits.placed) return edits.placed->moves_of_file(first, std::move(own), edits);
  Moves result;
  result.values = std::move(own);
  result.changed.assign(result.values.size(), 0);
  const auto origin_at = [&](const Position& value) {
    return edits.moved ? edits.moved->origin_at(value, origin_) : origin_;
  };
  std::vector<Point> taken(edits.moved ? result.values.size() : 0);
  if (edits.moved) {
    std::vector<Point> before(taken.size());
    for (std::size_t i = 0; i < before.size(); ++i)
      before[i] = offset_of(result.values[i], origin_at(result.values[i]));
    edits.moved->take(first, result.values, before, taken);
  }
  const Cloud& cloud = edits.cloud;
  const Point* const points = edits.moved ? taken.data() : cloud.points.data() + first;
  for (std::size_t i = 0; i < result.values.size(); ++i) {
    const float now[3] = {points[i].x, points[i].y, points[i].z};
    const Position of_moved = origin_at(result.values[i]), &origin = edits.moved ? of_moved : cloud.origin;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double& value = result.values[i][axis];
      const float before = to_offset(value, of_moved[axis]);
      const double shift = cloud.origin[axis] - origin_[axis];
      // -0 is 0, and stays as the file has it
      if (shift == 0 && (same_bits(before, now[axis]) || before == now[axis])) continue;
      value = io::moved_value(value, before, now[axis], origin[axis], shift);
      result.changed[i] |= static_cast<std::uint8_t>(1U << axis);
    }
  }
  return result;
}

std::filesystem::path io::companion_of(const Source& source, const std::string& extension) {
  std::filesystem::path path = platform::path_of(source.name());
  std::error_code ignored;
  for (const std::string& spelled : {extension, io::upper_case(extension)})
    if (std::filesystem::exists(path.replace_extension(spelled), ignored)) return path;
  return {};
}

void io::check_not_geographic(const Source& source) {
  if (source.info().is_geographic)
    fail(source.name(),
         "its X and Y are longitude and latitude in degrees, so distances mean nothing; project it to metres first, "
         "with filters.reprojection of PDAL for instance");
}

void io::check_has_points_of_file(const Cloud& cloud) {
  if (!cloud.source || cloud.source->size() == cloud.points.size()) return;
  throw Error(ErrorKind::usage, "the cloud has " + std::to_string(cloud.points.size()) + " points, its file " +
                                    std::to_string(cloud.source->size()) +
                                    "; keep them all, leave some out by without_points(), or go on without the source");
}

void Source::write(const io::Edits& edits, Encoding, io::Output& out) const {
  out.write(header(edits));
  io::write_blocks(out, block_count(), [&](std::size_t block, std::string& buffer) {
    append_block(block, moves(block, edits), edits, buffer);
    if (edits.removed.empty()) return;
    take_out(edits.removed.subspan(static_cast<std::size_t>(block_begin(block)), block_size(block)), edits, buffer);
  });
  out.write(tail());
}

}  // namespace pointfair
