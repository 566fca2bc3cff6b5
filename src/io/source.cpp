// SPDX-License-Identifier: Apache-2.0
#include "io/source.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <optional>

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

// Zeroed points. In large pages where the system has them: mapping small ones takes longer than reading the file.
std::vector<Point> new_points(std::size_t count) {
  std::vector<Point> points;
  points.reserve(count);
#ifdef MADV_HUGEPAGE
  constexpr std::uintptr_t kPage = std::uintptr_t{1} << 21;
  const auto begin = (reinterpret_cast<std::uintptr_t>(points.data()) + kPage - 1) & ~(kPage - 1);
  const auto end = reinterpret_cast<std::uintptr_t>(points.data() + count) & ~(kPage - 1);
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
#endif
  points.resize(count);
  return points;
}

using io::same_bits;
using io::to_offset;

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

Position Source::sampled_origin() const {
  std::vector<Position> sample;
  const std::size_t blocks = block_count(), block_step = std::max<std::size_t>(1, blocks / kSampledBlocks);
  for (std::size_t block = 0; block < blocks; block += block_step) {
    std::vector<Position> values(block_size(block));
    positions(block, values);
    const std::size_t step = std::max<std::size_t>(1, values.size() / kSampledPerBlock);
    for (std::size_t i = 0; i < values.size(); i += step) sample.push_back(values[i]);
  }
  return io::choose_origin(std::move(sample));
}

std::vector<Point> Source::place() {
  const std::size_t blocks = block_count();
  origin_ = sampled_origin();
  std::vector<Point> points = new_points(static_cast<std::size_t>(size()));
  io::for_each_block(blocks, [&](std::size_t block) {
    Point* out = points.data() + block_begin(block);
    if (origin_ == Position{} && copy_points(block, {out, block_size(block)})) return;
    thread_local std::vector<Position> values;
    values.resize(block_size(block));
    positions(block, values);
    for (const Position& value : values) {
      *out++ = {to_offset(value[0], origin_[0]), to_offset(value[1], origin_[1]), to_offset(value[2], origin_[2])};
    }
  });
  return points;
}

Moves Source::moves(std::size_t block, const Cloud& cloud) const {
  Moves result;
  result.values.resize(block_size(block));
  result.changed.assign(result.values.size(), 0);
  positions(block, result.values);
  const std::size_t first = static_cast<std::size_t>(block_begin(block));
  for (std::size_t i = 0; i < result.values.size(); ++i) {
    const Point& point = cloud.points[first + i];
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

void Source::write(const Cloud& cloud, Encoding, io::Output& out) const {
  out.write(header(cloud.added));
  io::write_blocks(out, block_count(), [&](std::size_t block, std::string& buffer) {
    append_block(block, moves(block, cloud), cloud.added, buffer);
  });
  out.write(tail());
}

}  // namespace pointfair
