// SPDX-License-Identifier: Apache-2.0
// The k nearest other points of every point, through nanoflann's k-d tree: used by two of the peers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <nanoflann.hpp>
#include <span>
#include <string>
#include <vector>

#include "peer.hpp"

namespace peer {

inline std::string nanoflann_version() {  // 0xMmP
  constexpr int v = NANOFLANN_VERSION;
  return "nanoflann " + std::to_string(v >> 8) + "." + std::to_string(v >> 4 & 15) + "." + std::to_string(v & 15);
}

// How nanoflann sees an array of points; the names are its own.
struct PointArray {
  std::span<const Point> points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return axis == 0 ? points[i].x : axis == 1 ? points[i].y : points[i].z;
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;  // nanoflann computes it
  }
};

using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointArray>, PointArray, 3, std::uint32_t>;

// Row i holds the k nearest other points of point i, nearest first, with their squared distances.
struct NeighborLists {
  int k = 0;
  std::vector<std::uint32_t> indices;
  std::vector<float> squared_distances;

  std::span<const std::uint32_t> of(std::size_t i) const {
    return {indices.data() + i * static_cast<std::size_t>(k), static_cast<std::size_t>(k)};
  }
};

inline NeighborLists find_neighbors(const Tree& tree, std::span<const Point> points, int k, unsigned threads) {
  const std::size_t width = static_cast<std::size_t>(k);
  if (points.size() <= width) throw std::runtime_error("needs more than k points");
  NeighborLists lists{k, std::vector<std::uint32_t>(points.size() * width), std::vector<float>(points.size() * width)};
  parallel_for(points.size(), threads, [&](std::size_t i) {
    thread_local std::vector<std::uint32_t> found;
    thread_local std::vector<float> distances;
    found.resize(width + 1);
    distances.resize(width + 1);
    static_cast<void>(tree.knnSearch(&points[i].x, width + 1, found.data(), distances.data()));  // always width + 1
    // the point finds itself, unless more than k others lie on the same spot: then the last one goes
    std::size_t self = 0;
    while (self < width && found[self] != i) ++self;
    std::size_t at = i * width;
    for (std::size_t j = 0; j <= width; ++j) {
      if (j == self) continue;
      lists.indices[at] = found[j];
      lists.squared_distances[at++] = distances[j];
    }
  });
  return lists;
}

}  // namespace peer
