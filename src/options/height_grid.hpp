// SPDX-License-Identifier: Apache-2.0
// Mean heights over cells of the plane. They follow from the set of the points: neither their order nor what adds them
// changes a bit, so that points may come in parts and from many threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair {

class HeightGrid {
 public:
  /// A square of side 2^exponent and the sum of the heights of its points, in 2^-32 units: whole ones, and the rest.
  struct Cell {
    std::int32_t x = 0, y = 0;
    std::int64_t whole = 0;
    std::uint64_t part = 0, count = 0;
  };
  /// Bytes that a grid takes at most.
  static constexpr std::uint64_t kMostBytes = std::uint64_t{24} << 20;

  /// Of a cloud of so many points: cells are as small as powers of two can be of which a sixteenth of that number, and
  /// 2^19 at most, hold all points.
  explicit HeightGrid(std::uint64_t points);
  /// What cells() and exponent() of a finished one were.
  HeightGrid(int exponent, std::vector<Cell> cells);

  /// A finite point.
  void add(const Point& point);
  /// After the last point.
  void finish();

  const std::vector<Cell>& cells() const { return cells_; }
  int exponent() const { return exponent_; }
  /// The mean height in the cell that holds the point or, where that has no points, in the smallest of the larger ones
  /// that has; nothing without points.
  std::optional<double> height_at(const Point& point) const;

 private:
  bool holds(const Point& point) const;
  Cell cell_of(const Point& point) const;
  void settle();
  void coarsen();
  void make_larger();

  std::size_t most_cells_ = 0;
  int exponent_;
  std::vector<Cell> cells_, fresh_;          // in order; as they came
  std::vector<std::vector<Cell>> larger_{};  // each twice as wide as those before
};

}  // namespace pointfair
