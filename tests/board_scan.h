// SPDX-License-Identifier: Apache-2.0
// A scan of a board before a wall by one sensor, with mixed pixels between them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "pointfair/positions.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kStep = 0.004, kNoise = 0.002;  // radians, metres
inline constexpr Position kSensor{0.5, -1.0, 0.25};

// A board 3 m from the sensor, before a wall at 3.3 m, on a grid of rays; every other ray at the board's border ends
// somewhere between. Columns turn about the vertical.
struct Scan {
  shapes::Points points{};
  std::vector<Position> rays{};  // unit
  std::vector<double> range{};   // to the surface
  std::vector<std::uint8_t> is_mixed{};
  int columns = 0;
};

inline Scan scan(double noise = kNoise) {
  constexpr int kHalf = 90, kBoard = 40;  // rays
  Scan result{.columns = 2 * kHalf + 1};
  shapes::Random random(3);
  for (int row = -kHalf; row <= kHalf; ++row)
    for (int column = -kHalf; column <= kHalf; ++column) {
      const double a = column * kStep, e = row * kStep;
      const Position ray{std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e)};
      const bool on_board = std::abs(row) <= kBoard && std::abs(column) <= kBoard;
      const bool on_border = std::max(std::abs(row), std::abs(column)) == kBoard + 1;
      const double board = 3 / ray[1], wall = 3.3 / ray[1];
      const bool mixed = on_border && (row + column) % 2 == 0;
      const double range = mixed ? board + random.uniform(0.1, 0.9) * (wall - board) : on_board ? board : wall;
      const double told = range + noise * random.normal();
      result.points.push_back(
          shapes::make_point(kSensor[0] + told * ray[0], kSensor[1] + told * ray[1], kSensor[2] + told * ray[2]));
      result.rays.push_back(ray);
      result.range.push_back(on_board ? board : wall);
      result.is_mixed.push_back(mixed);
    }
  return result;
}

inline Ran run(const shapes::Points& points, std::span<const Position> viewpoint, const Params& params = {}) {
  return Ran(points, params, 0, viewpoint);
}

// With no place, and none sought.
inline const std::vector<Position>& nowhere() {
  static const std::vector<Position> place{Position{kNan, kNan, kNan}};
  return place;
}

inline Params marking() { return {.outliers = Outliers::mark}; }

struct Shares {
  double found = 0, wrong = 0;  // of the mixed pixels, of the others
};
inline Shares shares(const Scan& scan, const std::vector<std::uint8_t>& marks) {
  double found = 0, mixed = 0, wrong = 0;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    mixed += scan.is_mixed[i];
    (scan.is_mixed[i] != 0 ? found : wrong) += marks[i] != 0;
  }
  return {found / mixed, wrong / (double(marks.size()) - mixed)};
}

}  // namespace pointfair
