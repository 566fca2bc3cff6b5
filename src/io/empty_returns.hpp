// SPDX-License-Identifier: Apache-2.0
// Whether points at the origin are what a sensor writes where nothing came back.
#pragma once

#include <cstdint>
#include <span>

#include "io/origin_sample.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io {

/// Takes the positions of a cloud of so many points, in any order. Those at (0, 0, 0) are no points where there are two
/// or more, and more of them than others near the origin, within a quarter of the median distance from it: no sensor
/// measures so.
class EmptyReturns {
 public:
  explicit EmptyReturns(std::uint64_t points) : others_(points) {}
  void take(std::span<const Position> positions);
  bool are_empty() &&;

 private:
  std::uint64_t zeros_ = 0, finite_ = 0;  // finite_: without zeros
  OriginSample others_;
};

}  // namespace pointfair::io
