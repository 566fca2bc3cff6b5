// SPDX-License-Identifier: Apache-2.0
#include "io/source.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "io/large_pages.hpp"
#include "io/offset.hpp"
#include "io/parallel.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kSampledBlocks = 32, kSampledPerBlock = 128;

// A quarter of the extent, as a power of two: subtracting such a number from a float of this size is exact.
double rounding_step(double extent) { return std::exp2(std::floor(std::log2(extent)) - 2); }

struct Range {
  double low, high;
};

// The middle nine tenths, so that a stray point (or a zero written for "no return") does not hide large coordinates.
std::optional<Range> bulk_range(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  const std::size_t low = values.size() / 20, high = values.size() - 1 - low;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(low), values.end());
  const double smallest = values[low];
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(high), values.end());
  return Range{smallest, values[high]};
}

// Zeroed points.
std::vector<Point> new_points(std::size_t count) {
  std::vector<Point> points;
  points.reserve(count);
  io::prefer_large_pages(points.data(), count * sizeof(Point));
  points.resize(count);
  return points;
}

using io::same_bits;
using io::to_offset;

// Positions of a file, chosen by a hash of their coordinates, so that the order of the points does not matter; its
// words are mixed as in the 64-bit MurmurHash3 (A. Appleby).
class PositionSample {
 public:
  explicit PositionSample(std::uint64_t points)
      : limit_(points > kWanted ? ~std::uint64_t{0} / points * kWanted : ~std::uint64_t{0}) {}

  void offer(const Position& p) {
    std::uint64_t hash = 0x9e3779b97f4a7c15u;
    for (const double c : p) {
      hash = (hash ^ std::bit_cast<std::uint64_t>(c + 0.0)) * 0xff51afd7ed558ccdu;
      hash ^= hash >> 33;
    }
    if (hash * 0xc4ceb9fe1a85ec53u <= limit_) chosen_.push_back(p);
    if (std::isfinite(p[0] + p[1] + p[2])) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        least_[axis] = std::min(least_[axis], p[axis]);
        most_[axis] = std::max(most_[axis], p[axis]);
      }
    }
  }
  void offer_all(const PositionSample& other) {
    chosen_.insert(chosen_.end(), other.chosen_.begin(), other.chosen_.end());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least_[axis] = std::min(least_[axis], other.least_[axis]);
      most_[axis] = std::max(most_[axis], other.most_[axis]);
    }
  }
  // Many points at few places may all have a hash beyond the limit; then the corners of their box.
  std::vector<Position> take() && {
    constexpr std::size_t kFew = 64;
    if (chosen_.size() < kFew && limit_ != ~std::uint64_t{0}) return {least_, most_};
    return std::move(chosen_);
  }

 private:
  static constexpr std::uint64_t kWanted = 4096;
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();
  std::uint64_t limit_;
  std::vector<Position> chosen_;
  Position least_{kInfinite, kInfinite, kInfinite}, most_{-kInfinite, -kInfinite, -kInfinite};
};

// What look(block, sample) offers of each block of the file, many at once.
template <class Look>
std::vector<Position> sample_of(const Source& source, const Look& look) {
  std::vector<PositionSample> of_block(source.block_count(), PositionSample(source.size()));
  io::for_each_block(source.block_count(), [&](std::size_t block) { look(block, of_block[block]); });
  PositionSample all(source.size());
  for (const PositionSample& sample : of_block) all.offer_all(sample);
  return std::move(all).take();
}

}  // namespace

namespace io {

Position choose_origin(std::vector<Position> sample) {
  // Float offsets from 0 lose log2(size / extent) of their 24 bits; up to 4 are given away.
  constexpr double kLarge = 16;
  std::erase_if(sample, [](const Position& p) { return !std::isfinite(p[0] + p[1] + p[2]); });
  std::array<std::optional<Range>, 3> ranges;
  double extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values(sample.size());
    std::transform(sample.begin(), sample.end(), values.begin(), [axis](const Position& p) { return p[axis]; });
    ranges[axis] = bulk_range(std::move(values));
    if (ranges[axis]) extent = std::max(extent, ranges[axis]->high - ranges[axis]->low);
  }
  Position origin{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!ranges[axis]) continue;
    const auto [low, high] = *ranges[axis];
    const double size = std::max(std::abs(low), std::abs(high));
    const double centre = low + (high - low) / 2;
    if (extent == 0 && static_cast<double>(static_cast<float>(low)) == low) continue;
    const double width = extent == 0 ? 1 : extent;
    if (!(size > kLarge * width)) continue;
    const double step = rounding_step(width);
    const double rounded = std::nearbyint(centre / step) * step;
    if (std::isfinite(rounded)) origin[axis] = rounded;
  }
  return origin;
}

}  // namespace io

Position Source::guessed_origin() const {
  std::vector<Position> rows;
  const std::size_t blocks = block_count(), block_step = std::max<std::size_t>(1, blocks / kSampledBlocks);
  for (std::size_t block = 0; block < blocks; block += block_step) {
    std::vector<Position> values(block_size(block));
    positions(block, values);
    const std::size_t step = std::max<std::size_t>(1, values.size() / kSampledPerBlock);
    for (std::size_t i = 0; i < values.size(); i += step) rows.push_back(values[i]);
  }
  return io::choose_origin(std::move(rows));
}

// A guess saves a second pass: it is nearly always what the sample shows.
std::vector<Point> Source::place() {
  origin_ = guessed_origin();
  std::vector<Point> points = new_points(static_cast<std::size_t>(size()));
  const Position origin = io::choose_origin(place_at_origin(points));
  if (origin != origin_) {
    origin_ = origin;
    place_at_origin(points);
  }
  return points;
}

Position Source::sampled_origin() const {
  return io::choose_origin(sample_of(*this, [&](std::size_t block, PositionSample& sample) {
    thread_local std::vector<Position> values;
    values.resize(block_size(block));
    positions(block, values);
    for (const Position& value : values) sample.offer(value);
  }));
}

std::vector<Position> Source::place_at_origin(std::span<Point> points) const {
  return sample_of(*this, [&](std::size_t block, PositionSample& sample) {
    const std::span<Point> out = points.subspan(static_cast<std::size_t>(block_begin(block)), block_size(block));
    if (origin_ == Position{} && copy_points(block, out)) {
      for (const Point& p : out) sample.offer({p.x, p.y, p.z});
      return;
    }
    thread_local std::vector<Position> values;
    values.resize(out.size());
    positions(block, values);
    for (std::size_t i = 0; i < out.size(); ++i) {
      const Position& value = values[i];
      sample.offer(value);
      out[i] = {to_offset(value[0], origin_[0]), to_offset(value[1], origin_[1]), to_offset(value[2], origin_[2])};
    }
  });
}

Moves Source::moves(std::size_t block, const Cloud& cloud) const {
  std::vector<Position> own(block_size(block));
  positions(block, own);
  return moves(block_begin(block), std::move(own), cloud);
}

Moves Source::moves(std::uint64_t first, std::vector<Position> own, const Cloud& cloud) const {
  Moves result;
  result.values = std::move(own);
  result.changed.assign(result.values.size(), 0);
  for (std::size_t i = 0; i < result.values.size(); ++i) {
    const Point& point = cloud.points[static_cast<std::size_t>(first) + i];
    const float now[3] = {point.x, point.y, point.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double& value = result.values[i][axis];
      const float before = to_offset(value, origin_[axis]);
      const double shift = cloud.origin[axis] - origin_[axis];
      if (shift == 0 && same_bits(before, now[axis])) continue;
      value = io::moved_value(value, before, now[axis], cloud.origin[axis], shift);
      result.changed[i] |= static_cast<std::uint8_t>(1U << axis);
    }
  }
  return result;
}

void Source::write(const io::Edits& edits, Encoding, io::Output& out) const {
  out.write(header(edits.added));
  io::write_blocks(out, block_count(), [&](std::size_t block, std::string& buffer) {
    append_block(block, moves(block, edits.cloud), edits, buffer);
  });
  out.write(tail());
}

}  // namespace pointfair
