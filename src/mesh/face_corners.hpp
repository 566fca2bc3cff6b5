// SPDX-License-Identifier: Apache-2.0
// The corners of faces as vertices, and which faces are degenerate.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

// `vertex`: of each point, as MeshEdges. What is passed must outlive this.
class FaceCorners {
 public:
  FaceCorners(const Polygons& faces, std::span<const std::uint32_t> vertex) : faces_(faces), vertex_(vertex) {}

  // Calls visit(corners) for each face from `first` to before `last` that is not degenerate, and returns how many are.
  // A corner at the place of the one before it is no corner; a face is degenerate if fewer than three are left, if it
  // meets a place twice, or if a corner is not finite.
  template <class Visit>
  std::uint64_t for_each(std::size_t first, std::size_t last, const Visit& visit) {
    std::uint64_t degenerate = 0, begin = first == 0 ? 0 : faces_.ends[first - 1];
    for (std::size_t face = first; face < last; ++face) {
      const std::uint64_t end = faces_.ends[face];
      if (take(begin, end)) {
        visit(std::span<std::uint32_t>(corners_));
      } else {
        ++degenerate;
      }
      begin = end;
    }
    return degenerate;
  }

 private:
  bool take(std::uint64_t begin, std::uint64_t end) {
    corners_.clear();
    for (std::uint64_t c = begin; c < end; ++c) {
      const std::uint32_t at = vertex_[faces_.corners[c]];
      if (at == kNoVertex) return false;
      if (corners_.empty() || corners_.back() != at) corners_.push_back(at);
    }
    while (corners_.size() > 1 && corners_.back() == corners_.front()) corners_.pop_back();
    return corners_.size() >= 3 && all_differ();
  }
  bool all_differ() {
    if (corners_.size() == 3) return true;  // those beside each other do
    sorted_ = corners_;
    std::ranges::sort(sorted_);
    return std::ranges::adjacent_find(sorted_) == sorted_.end();
  }

  const Polygons& faces_;
  std::span<const std::uint32_t> vertex_;
  std::vector<std::uint32_t> corners_, sorted_;
};

}  // namespace pointfair
