// SPDX-License-Identifier: Apache-2.0
// Loops and sorts over blocks of fixed size, so that no result depends on the number of threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <vector>

#include "seam/cloud_sample.hpp"

namespace pointfair {

inline constexpr std::size_t kMeshBlock = 4096;

inline std::size_t mesh_blocks(std::size_t items) { return (items + kMeshBlock - 1) / kMeshBlock; }

// Calls body(first, last, block) for the blocks of `items` items, many at once.
template <class Body>
void for_mesh_blocks(std::size_t items, const ForEach& for_each, const Body& body) {
  for_each(mesh_blocks(items),
           [&](std::size_t block) { body(block * kMeshBlock, std::min(items, (block + 1) * kMeshBlock), block); });
}

// By an order in which no two items are alike.
template <class Item, class Less>
void sort_in_parts(std::vector<Item>& items, const ForEach& for_each, const Less& less) {
  constexpr std::size_t kParts = 16;
  const auto bound = [&](std::size_t part) { return std::ptrdiff_t(items.size() * part / kParts); };
  for_each(kParts, [&](std::size_t p) { std::sort(items.begin() + bound(p), items.begin() + bound(p + 1), less); });
  std::vector<Item> merged(items.size());
  for (std::size_t width = 1; width < kParts; width *= 2) {
    for_each(kParts / (2 * width), [&](std::size_t pair) {
      const auto first = bound(2 * width * pair), middle = bound(2 * width * pair + width),
                 last = bound(2 * width * (pair + 1));
      std::merge(items.begin() + first, items.begin() + middle, items.begin() + middle, items.begin() + last,
                 merged.begin() + first, less);
    });
    std::swap(items, merged);
  }
}

}  // namespace pointfair
