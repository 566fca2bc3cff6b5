// SPDX-License-Identifier: Apache-2.0
#include "io/las/octree.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>

#include "io/parallel.hpp"

namespace pointfair::io::las {
namespace {

// The root's cube is cut into 2^7 cells an axis, of which each gives the root one point.
constexpr int kCellLevels = 7, kLevels = 21, kDeepest = kLevels - kCellLevels;
constexpr std::size_t kBlock = 65536;

std::uint64_t spread_bits(std::uint64_t value) {  // 21 bits, each third one
  value = (value | value << 32) & 0x1F00000000FFFF;
  value = (value | value << 16) & 0x1F0000FF0000FF;
  value = (value | value << 8) & 0x100F00F00F00F00F;
  value = (value | value << 4) & 0x10C30C30C30C30C3;
  return (value | value << 2) & 0x1249249249249249;
}

struct Place {
  std::uint64_t code;  ///< digit by digit which eighth of the cube before: bit 0 of each is that of x
  std::uint32_t point;
  bool operator<(const Place& other) const { return code != other.code ? code < other.code : point < other.point; }
};

class Builder {
 public:
  Builder(const Cube& cube, std::size_t count, const std::function<Position(std::size_t)>& position) : places_(count) {
    constexpr double kCells = double(1 << kLevels);
    for_each_block((count + kBlock - 1) / kBlock, [&](std::size_t block) {
      for (std::size_t i = block * kBlock; i < std::min(count, (block + 1) * kBlock); ++i) {
        const Position p = position(i);
        std::uint64_t code = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double share = (p[axis] - (cube.center[axis] - cube.half_side)) / (2 * cube.half_side);
          const double cell = std::clamp(std::floor(share * kCells), 0.0, kCells - 1);
          code |= spread_bits(static_cast<std::uint64_t>(cell)) << axis;
        }
        places_[i] = {code, static_cast<std::uint32_t>(i)};
      }
    });
    tbb::parallel_sort(places_.begin(), places_.end());
  }

  std::vector<OctreeNode> build() {
    visit({}, 0, places_.size());
    std::ranges::stable_sort(nodes_, {}, &OctreeNode::level);
    return std::move(nodes_);
  }

 private:
  // The node of the places [first, last), which are sorted; those that it does not take go to its children.
  void visit(OctreeNode node, std::size_t first, std::size_t last) {
    const bool takes_all = last - first <= kFew || node.level == kDeepest;
    const std::size_t left = takes_all ? first : take_one_of_each_cell(node, first, last);
    if (takes_all)
      for (std::size_t i = first; i < last; ++i) node.points.push_back(places_[i].point);
    std::ranges::sort(node.points);
    const OctreeNode parent{node.level, node.at, {}};
    nodes_.push_back(std::move(node));
    const int shift = 3 * (kLevels - 1 - parent.level);
    for (std::size_t begin = first; begin < left;) {
      const std::uint64_t eighth = places_[begin].code >> shift;
      std::size_t end = begin;
      while (end < left && places_[end].code >> shift == eighth) ++end;
      OctreeNode child{parent.level + 1, parent.at, {}};
      for (std::size_t axis = 0; axis < 3; ++axis)
        child.at[axis] = 2 * parent.at[axis] + static_cast<std::int32_t>(eighth >> axis & 1);
      visit(std::move(child), begin, end);
      begin = end;
    }
  }

  // The middle one of each cell's points, which stand together. Moves the others to the front; returns their end.
  std::size_t take_one_of_each_cell(OctreeNode& node, std::size_t first, std::size_t last) {
    const int shift = 3 * (kDeepest - node.level);
    std::size_t left = first;
    for (std::size_t begin = first; begin < last;) {
      std::size_t end = begin;
      while (end < last && places_[end].code >> shift == places_[begin].code >> shift) ++end;
      const std::size_t middle = begin + (end - begin) / 2;
      node.points.push_back(places_[middle].point);
      for (std::size_t i = begin; i < end; ++i)
        if (i != middle) places_[left++] = places_[i];
      begin = end;
    }
    return left;
  }

  std::vector<Place> places_;
  std::vector<OctreeNode> nodes_;
};

}  // namespace

Cube cube_around(const Position& min, const Position& max) {
  Cube cube;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cube.center[axis] = min[axis] + (max[axis] - min[axis]) / 2;
    cube.half_side = std::max(cube.half_side, (max[axis] - min[axis]) / 2);
  }
  // Points on the faces are inside, whatever is rounded.
  cube.half_side = cube.half_side > 0 ? cube.half_side * (1 + 1e-9) : 1;
  cube.spacing = 2 * cube.half_side / (1 << kCellLevels);
  return cube;
}

std::vector<OctreeNode> make_octree(const Cube& cube, std::size_t count,
                                    const std::function<Position(std::size_t)>& position) {
  return Builder(cube, count, position).build();
}

}  // namespace pointfair::io::las
