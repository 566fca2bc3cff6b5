// SPDX-License-Identifier: Apache-2.0
#include "tiles/cut.hpp"

#include <algorithm>
#include <bit>
#include <memory>
#include <numeric>
#include <optional>

#include "tiles/halo.hpp"
#include "tiles/halves.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kBlock = 1 << 13;    // points
constexpr std::size_t kSamples = 1 << 16;  // of which the cells are made

std::size_t blocks_of(std::size_t points) { return (points + kBlock - 1) / kBlock; }

constexpr float point::Vec3<float>::*kCellAxes[] = {&point::Vec3<float>::x, &point::Vec3<float>::y,
                                                    &point::Vec3<float>::z};

constexpr std::size_t kWordBits = 64;

std::span<const Point> block_of(std::span<const Point> points, std::size_t block) {
  return points.subspan(block * kBlock, std::min(kBlock, points.size() - block * kBlock));
}

// A bit for each of up to 64 points: whether it is valid and in the region.
std::uint64_t bits_inside(const point::Region& r, std::span<const Point> points) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    const bool in = bool(int(p.x >= r.min.x) & int(p.x <= r.max.x) & int(p.y >= r.min.y) & int(p.y <= r.max.y) &
                         int(p.z >= r.min.z) & int(p.z <= r.max.z) & int(is_indexed(p)));
    bits |= std::uint64_t(in) << i;
  }
  return bits;
}

void split(std::span<Point> sample, std::size_t parts, const Cell& cell, std::vector<Cell>& cells) {
  const std::optional<Halves> halves = halve(sample, parts);
  if (!halves) {
    cells.push_back(cell);
    return;
  }
  Cell left = cell, right = cell;
  left.max.*kCellAxes[halves->axis] = right.min.*kCellAxes[halves->axis] = halves->plane;
  split(halves->left, halves->left_parts, left, cells);
  split(halves->right, parts - halves->left_parts, right, cells);
}

}  // namespace

std::vector<Cell> cells_of(std::span<Point> sample, std::size_t cells) {
  std::vector<Cell> result;
  split(sample, std::max<std::size_t>(1, cells),
        {{-kUnbounded, -kUnbounded, -kUnbounded}, {kUnbounded, kUnbounded, kUnbounded}}, result);
  return result;
}

Cut::Cut(std::span<const Point> points, std::size_t tiles, const ForEach& for_each) : points_(points) {
  block_bounds_.assign(blocks_of(points.size()), kNoBounds);
  for_each(block_bounds_.size(), [&](std::size_t block) {
    for (const Point& p : block_of(points, block))
      if (is_indexed(p)) include(block_bounds_[block], p);
  });
  bounds_ = kNoBounds;
  for (const Bounds& b : block_bounds_) unite(bounds_, b);
  if (bounds_.valid == 0) {
    bounds_ = {};
    return;
  }
  std::vector<Point> sample;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kSamples);
  for (std::size_t i = 0; i < points.size(); i += stride)
    if (is_indexed(points[i])) sample.push_back(points[i]);
  for (const Cell& cell : cells_of(sample, tiles)) tiles_.push_back({cell, kNoBounds});

  std::vector<std::vector<Bounds>> of_block(block_bounds_.size());
  for_each(block_bounds_.size(), [&](std::size_t block) {
    std::vector<Bounds>& cores = of_block[block];
    cores.assign(tiles_.size(), kNoBounds);
    const Bounds& bounds = block_bounds_[block];
    for (std::size_t tile = 0; tile < tiles_.size(); ++tile)
      if (is_in_cell(tiles_[tile].cell, to_vec3(bounds.min)) && is_in_cell(tiles_[tile].cell, to_vec3(bounds.max))) {
        cores[tile] = bounds;  // all of the block
        return;
      }
    for (const Point& p : block_of(points, block))
      for (std::size_t tile = 0; tile < tiles_.size(); ++tile)
        if (is_in_cell(tiles_[tile].cell, to_vec3(p))) {
          if (is_indexed(p)) include(cores[tile], p);
          break;
        }
  });
  for (const auto& cores : of_block)
    for (std::size_t tile = 0; tile < cores.size(); ++tile) unite(tiles_[tile].core, cores[tile]);
}

// One look at each point of blocks that lie partly inside, without a branch: half of them may be in. A bit each is
// kept, so that they are counted before there is room for them.
void Cut::find(const point::Region& region, const ForEach& for_each, std::vector<std::uint32_t>& indices) const {
  std::vector<std::size_t> blocks;
  for (std::size_t block = 0; block < block_bounds_.size(); ++block)
    if (may_overlap(region, block_bounds_[block])) blocks.push_back(block);
  constexpr std::size_t kWords = kBlock / kWordBits;
  const auto inside = std::make_unique_for_overwrite<std::uint64_t[]>(blocks.size() * kWords);
  std::vector<std::size_t> start(blocks.size() + 1, 0);
  for_each(blocks.size(), [&](std::size_t b) {
    const std::span<const Point> points = block_of(points_, blocks[b]);
    const Bounds& bounds = block_bounds_[blocks[b]];
    if (bounds.valid == points.size() && lies_inside(region, bounds)) {
      start[b + 1] = points.size();
      return;
    }
    for (std::size_t word = 0; word < kWords; ++word) {
      const std::size_t first = std::min(points.size(), word * kWordBits);
      const std::uint64_t bits =
          bits_inside(region, points.subspan(first).first(std::min(kWordBits, points.size() - first)));
      inside[b * kWords + word] = bits;
      start[b + 1] += std::size_t(std::popcount(bits));
    }
  });
  for (std::size_t b = 0; b < blocks.size(); ++b) start[b + 1] += start[b];
  indices.resize(start.back());
  for_each(blocks.size(), [&](std::size_t b) {
    const auto first = std::uint32_t(blocks[b] * kBlock);
    std::size_t to = start[b];
    if (start[b + 1] - to == block_of(points_, blocks[b]).size()) {
      std::iota(indices.begin() + std::ptrdiff_t(to), indices.begin() + std::ptrdiff_t(start[b + 1]), first);
      return;
    }
    for (std::size_t word = 0; word < kWords; ++word)
      for (std::uint64_t bits = inside[b * kWords + word]; bits != 0; bits &= bits - 1)
        indices[to++] = first + std::uint32_t(word * kWordBits) + std::uint32_t(std::countr_zero(bits));
  });
}

}  // namespace pointfair
