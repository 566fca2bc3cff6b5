// SPDX-License-Identifier: Apache-2.0
// Positions of a cloud's leaves that stay in memory while there is room: what is looked at several times is read once.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <vector>

#include "scale/stored_cloud.hpp"

namespace pointfair::scale {

class KeptLeaves {
 public:
  /// `most`: points that are kept.
  KeptLeaves(const StoredCloud& cloud, std::uint64_t most)
      : cloud_(cloud), most_(most), leaves_(cloud.leaves().size()) {}

  std::uint64_t kept() const { return kept_; }
  /// Keeps nothing any more.
  void forget();
  /// The points of the region, if they are at most `most`, of the cloud as it is seen from some origin; else nothing is
  /// kept any more, and false.
  bool load(const StoredCloud& seen, const point::Region& region, std::uint64_t most, std::vector<Point>& points);
  /// The points of a leaf, relative to the middle of its zone. Valid until the next call.
  std::span<const Point> leaf(std::uint32_t number);
  /// Calls visit(points) for all points, some at a time.
  void for_all(const std::function<void(std::span<const Point>)>& visit);

 private:
  const StoredCloud& cloud_;
  std::uint64_t most_, kept_ = 0;
  std::vector<std::span<const Point>> leaves_;  // in blocks_; empty: not kept. As stored
  std::deque<std::vector<Point>> blocks_;       // large ones, which the system gets back at once
  std::vector<Point> passing_;                  // the leaf that was read last
  std::vector<Point> brought_;
};

}  // namespace pointfair::scale
