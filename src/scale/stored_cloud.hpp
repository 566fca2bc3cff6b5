// SPDX-License-Identifier: Apache-2.0
// The points of one iteration's input, in the files that the tasks before left: which leaves there are, and all points
// of a region.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "point/region.h"
#include "scale/points_file.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair::scale {

/// Leaves that follow each other.
struct LeafRange {
  std::uint32_t begin = 0, end = 0;
  bool holds(std::uint32_t leaf) const { return leaf >= begin && leaf < end; }
};

class StoredCloud {
 public:
  StoredCloud(const std::vector<std::filesystem::path>& files, std::size_t leaves);

  const Bounds& bounds() const { return bounds_; }
  const std::vector<Bounds>& leaves() const { return leaf_bounds_; }
  /// What the files' tasks counted, in all.
  const TaskCounts& counts() const { return counts_; }
  std::uint64_t count_of(const LeafRange& range) const;
  Bounds bounds_of(const LeafRange& range) const;

  /// The points of the leaves, leaf after leaf, and in the same order their indices in the input; of both, what is
  /// given.
  void read(const LeafRange& range, std::vector<Point>* points, std::vector<std::uint64_t>* indices) const;
  /// Appends the points of the region, those of the leaves in `except` left out. At most `most` of them are wanted:
  /// false as soon as there are more.
  bool append(const point::Region& region, const LeafRange& except, std::size_t most, std::vector<Point>& points) const;
  /// Calls visit(points) for all points, a few at a time.
  void for_all(const std::function<void(std::span<const Point>)>& visit) const;

 private:
  // Where the points of the leaves are in a file: `begin[i]` of the i-th leaf that it has, and past the last.
  struct Part {
    std::unique_ptr<PointsFile> file;
    std::vector<std::uint32_t> leaves;
    std::vector<std::uint64_t> begins;
  };

  std::vector<std::filesystem::path> files_;
  std::vector<Part> parts_;
  std::vector<Bounds> leaf_bounds_;
  Bounds bounds_ = kNoBounds;
  TaskCounts counts_{};
};

/// Whether all points of `b` lie in the region, and whether some may.
bool lies_inside(const point::Region& region, const Bounds& b);
bool may_overlap(const point::Region& region, const Bounds& b);

}  // namespace pointfair::scale
