// SPDX-License-Identifier: Apache-2.0
// Whether points at the origin are what a sensor writes where nothing came back.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pointfair/positions.hpp"

namespace pointfair::io {

/// Takes the positions of a cloud. Those at (0, 0, 0) are no points where there are two or more, and more of them than
/// others near the origin, within a quarter of the median distance from it: no sensor measures so.
class EmptyReturns {
 public:
  explicit EmptyReturns(std::uint64_t points);
  void take(std::uint64_t first, std::span<const Position> positions);
  bool are_empty() const;

 private:
  std::uint64_t step_, zeros_ = 0;
  std::vector<double> distances_;  // of every step_th other point, from the origin
};

}  // namespace pointfair::io
