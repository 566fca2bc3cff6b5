// SPDX-License-Identifier: Apache-2.0
#include "scale/leaf_tree.hpp"

#include <limits>
#include <optional>

#include "scale/work_file.hpp"
#include "tiles/halves.hpp"

namespace pointfair::scale {
LeafTree::LeafTree(std::span<Point> sample, std::size_t tiles, std::size_t leaves_of_tile) {
  tile_begins_.push_back(0);
  nodes_.push_back({0, std::numeric_limits<float>::infinity(), {0, 0}});  // all lies below it
  const std::int32_t root = split(sample, tiles, leaves_of_tile);
  nodes_[0].next[0] = nodes_[0].next[1] = root;
  if (tile_begins_.back() != made_) tile_begins_.push_back(made_);
}

// Into parts at the rank of the sample that shares it as the parts are to be shared; a part is a tile, and is then
// split into its leaves (leaves_of_part > 0).
std::int32_t LeafTree::split(std::span<Point> sample, std::size_t parts, std::size_t leaves_of_part) {
  const std::optional<Halves> halves = halve(sample, parts);
  if (!halves) {
    if (leaves_of_part > 0) {
      const std::int32_t tile = split(sample, leaves_of_part, 0);
      tile_begins_.push_back(made_);
      return tile;
    }
    return ~static_cast<std::int32_t>(made_++);
  }
  const auto at = static_cast<std::int32_t>(nodes_.size());
  nodes_.push_back({halves->axis, halves->plane, {0, 0}});
  const std::int32_t below = split(halves->left, halves->left_parts, leaves_of_part);
  const std::int32_t above = split(halves->right, parts - halves->left_parts, leaves_of_part);
  nodes_[static_cast<std::size_t>(at)].next[0] = below;
  nodes_[static_cast<std::size_t>(at)].next[1] = above;
  return at;
}

void LeafTree::move(const std::array<double, 3>& shift) {
  for (Node& node : nodes_) node.plane = static_cast<float>(node.plane - shift[static_cast<std::size_t>(node.axis)]);
}

void LeafTree::save(const std::filesystem::path& path) const {
  NewFile file(path);
  const std::uint64_t sizes[2] = {nodes_.size(), tile_begins_.size()};
  file.write(sizes, sizeof sizes);
  file.write(std::span(nodes_));
  file.write(std::span(tile_begins_));
  file.finish();
}

LeafTree::LeafTree(const std::filesystem::path& path) {
  const StoredFile file(path);
  std::uint64_t sizes[2];
  file.read(0, sizes, sizeof sizes);
  nodes_.resize(sizes[0]);
  tile_begins_.resize(sizes[1]);
  file.read(sizeof sizes, std::span(nodes_));
  file.read(sizeof sizes + sizes[0] * sizeof(Node), std::span(tile_begins_));
}

}  // namespace pointfair::scale
