// SPDX-License-Identifier: Apache-2.0
// Space in leaves of about as many points each: a k-d tree that is made of a sample. Leaves that follow each other are
// near each other, and those of one tile follow each other. Which leaf a point is in decides where it is stored, and
// no result.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair::scale {

class LeafTree {
 public:
  /// About `tiles` times `leaves_of_tile` leaves; fewer where points of the sample are identical.
  LeafTree(std::span<Point> sample, std::size_t tiles, std::size_t leaves_of_tile);

  /// Of a valid point.
  std::uint32_t leaf_of(const Point& p) const {
    std::int32_t at = 0;
    while (at >= 0) {
      const Node& node = nodes_[static_cast<std::size_t>(at)];
      const float c[3] = {p.x, p.y, p.z};
      at = node.next[c[node.axis] >= node.plane];
    }
    return static_cast<std::uint32_t>(~at);
  }
  std::size_t leaves() const { return tile_begins_.back(); }
  std::size_t tiles() const { return tile_begins_.size() - 1; }
  /// The first leaf of the tile; that of the tile past the last is the number of leaves.
  std::uint32_t tile_begin(std::size_t tile) const { return tile_begins_[tile]; }

  /// The same leaves for points whose coordinates are less by `shift`, but for rounding.
  void move(const std::array<double, 3>& shift);

  void save(const std::filesystem::path& path) const;
  explicit LeafTree(const std::filesystem::path& path);

 private:
  struct Node {
    std::int32_t axis = 0;
    float plane = 0;
    std::int32_t next[2]{};  // below the plane, and from it on: a node, or ~leaf
  };
  std::int32_t split(std::span<Point> sample, std::size_t parts, std::size_t leaves_of_part);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> tile_begins_;
  std::uint32_t made_ = 0;  // leaves
};

}  // namespace pointfair::scale
