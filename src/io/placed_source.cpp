// SPDX-License-Identifier: Apache-2.0
#include "io/placed_source.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "io/offset.hpp"
#include "io/parallel.hpp"

namespace pointfair {
namespace io {
namespace {

constexpr std::size_t kBlock = 4096;

bool same_value(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b) || (std::isnan(a) && std::isnan(b));
}

bool fit_floats(std::span<const Position> positions) {
  return std::ranges::all_of(positions, [](const Position& position) {
    return std::ranges::all_of(position, [](double value) { return same_value(static_cast<float>(value), value); });
  });
}

// Moves the points of `cloud` as far as their positions, which are `now`, are from those that are wanted.
void move_points(Cloud& cloud, std::span<const Position> now, std::span<const Position> wanted) {
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    float* const point[3] = {&cloud.points[i].x, &cloud.points[i].y, &cloud.points[i].z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (same_value(now[i][axis], wanted[i][axis])) continue;
      const double moved = *point[axis] + (wanted[i][axis] - now[i][axis]);
      *point[axis] = std::isfinite(moved) ? static_cast<float>(moved) : to_offset(wanted[i][axis], cloud.origin[axis]);
    }
  }
}

bool has_positions(const Cloud& cloud, std::span<const Position> wanted) {
  if (position_type(cloud) == ScalarType::float32 && !fit_floats(wanted)) return false;
  std::vector<Position> has(wanted.size());
  positions(cloud, has);
  return std::equal(has.begin(), has.end(), wanted.begin(), [](const Position& a, const Position& b) {
    return std::equal(a.begin(), a.end(), b.begin(), same_value);
  });
}

}  // namespace

PlacedSource::PlacedSource(std::shared_ptr<const Source> file, std::vector<Position> positions,
                           std::optional<ScalarType> type)
    : Source(FileBytes::copy({}), file ? file->name() : "array", file ? file->format() : Format::xyz,
             file ? file->encoding() : Encoding::ascii),
      file_(std::move(file)),
      positions_(std::move(positions)),
      type_(ScalarType::float64) {
  if (type) {
    type_ = *type;
    return;
  }
  const bool was_float = !file_ || file_->coordinate_type() == ScalarType::float32;
  type_ = was_float && fit_floats(positions_) ? ScalarType::float32 : ScalarType::float64;
}

std::size_t PlacedSource::block_count() const {
  return file_ ? file_->block_count() : (positions_.size() + kBlock - 1) / kBlock;
}

std::uint64_t PlacedSource::block_begin(std::size_t block) const {
  return file_ ? file_->block_begin(block) : std::min(block * kBlock, positions_.size());
}

void PlacedSource::positions(std::size_t block, std::span<Position> out) const {
  const auto part = std::span(positions_).subspan(static_cast<std::size_t>(block_begin(block)), out.size());
  std::ranges::copy(part, out.begin());
}

std::vector<Column> PlacedSource::columns() const { return file_ ? file_->columns() : std::vector<Column>{}; }

void PlacedSource::extract_block(std::size_t index, std::size_t block, std::span<char> out) const {
  file_->extract_block(index, block, out);
}

std::optional<Position> PlacedSource::sensor(std::size_t block) const {
  return file_ ? file_->sensor(block) : std::nullopt;
}

std::vector<std::string> PlacedSource::companions() const {
  return file_ ? file_->companions() : std::vector<std::string>{};
}

// Floats that are large against the extent are as coarse as what choose_origin does away with.
bool PlacedSource::holds_its_positions() const {
  if (!file_ || !file_->holds_its_positions()) return false;
  return file_->coordinate_type() != ScalarType::float32 || type_ == ScalarType::float32 || origin() == Position{};
}

std::vector<std::string> PlacedSource::losses(Encoding to) const {
  std::vector<std::string> result = file_ ? file_->losses(to) : std::vector<std::string>{};
  const bool is_of_memory = name().empty();
  if (file_ && !is_of_memory && file_->holds_its_positions() && !holds_its_positions())
    result.push_back(
        "the coordinates of the file are 32-bit floats, which would round the positions that were given: "
        "the file is written anew, in double, with its attributes and faces and without its comments");
  return result;
}

// Where it was placed again, the last place counts.
Edits PlacedSource::edits_of_file(Edits edits) const {
  if (!edits.placed) edits.placed = this;
  return edits;
}

std::vector<std::string> PlacedSource::losses_of_moves(const Edits& edits) const {
  return file_ ? file_->losses_of_moves(edits_of_file(edits)) : std::vector<std::string>{};
}

void PlacedSource::write(const Edits& edits, Encoding encoding, Output& out) const {
  file_->write(edits_of_file(edits), encoding, out);
}

Moves PlacedSource::moves_of_file(std::uint64_t first, std::vector<Position> of_file, const Edits& edits) const {
  Edits mine = edits;
  mine.placed = nullptr;
  const auto part = std::span(positions_).subspan(static_cast<std::size_t>(first), of_file.size());
  Moves result = moves(first, {part.begin(), part.end()}, mine);
  for (std::size_t i = 0; i < of_file.size(); ++i) {
    result.changed[i] = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (!same_value(of_file[i][axis], result.values[i][axis]))
        result.changed[i] |= static_cast<std::uint8_t>(1U << axis);
  }
  return result;
}

Cloud placed(const Cloud& cloud, std::vector<Position> positions, std::optional<ScalarType> type) {
  const auto* const before = dynamic_cast<const PlacedSource*>(cloud.source.get());
  const auto source =
      std::make_shared<PlacedSource>(before ? before->file() : cloud.source, std::move(positions), type);
  Cloud result{cloud.origin, source->place(), cloud.added, source};
  if (source->origin() == cloud.origin) return result;
  source->place_at(cloud.origin);
  for_each_block(source->block_count(), [&](std::size_t block) {
    OriginSample unused(source->size());
    const auto begin = static_cast<std::size_t>(source->block_begin(block));
    source->place_block(block, std::span(result.points).subspan(begin, source->block_size(block)), unused);
  });
  return result;
}

}  // namespace io

void set_positions(Cloud& cloud, std::span<const Position> wanted) {
  if (wanted.size() != cloud.points.size())
    throw Error(ErrorKind::usage, "the cloud has " + std::to_string(cloud.points.size()) + " points, the array " +
                                      std::to_string(wanted.size()) + "; a cloud keeps its number of points");
  std::vector<Position> now(wanted.size());
  positions(cloud, now);
  Cloud moved = cloud;
  io::move_points(moved, now, wanted);
  if (!io::has_positions(moved, wanted)) {
    const auto* const before = dynamic_cast<const io::PlacedSource*>(cloud.source.get());
    const auto source = std::make_shared<io::PlacedSource>(before ? before->file() : cloud.source,
                                                           std::vector<Position>(wanted.begin(), wanted.end()));
    moved.points = source->place();
    moved.origin = source->origin();
    moved.source = source;
  }
  cloud = std::move(moved);
}

}  // namespace pointfair
