// SPDX-License-Identifier: Apache-2.0
// The octree of a COPC file: each node holds some of the points of its cube, at a distance from each other that halves
// from level to level, and its children hold the others.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "io/las/grid.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io::las {

/// So many points are not worth nodes of their own: with as many or fewer there is one node, in the order of the file.
inline constexpr std::size_t kFew = 5000;

/// The cube of the root, and how far apart its points are.
struct Cube {
  Position center{};
  double half_side = 0, spacing = 0;
};

struct OctreeNode {
  std::int32_t level = 0;
  std::array<std::int32_t, 3> at{};   ///< which of the cubes of the level
  std::vector<std::uint32_t> points;  ///< in the order of the file
};

/// A cube around the box.
Cube cube_around(const Position& min, const Position& max);

/// The nodes, level after level, of `count` points that position(i) gives. Every point is in one node, within its cube.
/// A node with few points holds all of them. O(N log N); 16 bytes a point.
std::vector<OctreeNode> make_octree(const Cube& cube, std::size_t count,
                                    const std::function<Position(std::size_t)>& position);

}  // namespace pointfair::io::las
