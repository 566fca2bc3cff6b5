// SPDX-License-Identifier: Apache-2.0
// Divides a sample of a cloud at a plane, for trees that follow any density.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {

struct Halves {
  int axis;     // the longest of the sample
  float plane;  // points below it are left, the others right
  std::span<Point> left, right;
  std::size_t left_parts;
};
// Reorders `sample` and divides it at the rank that shares it as `parts` are shared: half of them to the left. Nothing
// for one part, and where all points are at one place.
std::optional<Halves> halve(std::span<Point> sample, std::size_t parts);

// Some of the points, by their numbers, ascending, on both sides of the middle of the longest side of their bounds. Not
// as many on each: one that lies far off is apart at once.
std::array<std::vector<std::uint32_t>, 2> halves_of(std::vector<std::uint32_t> some, std::span<const Point> points,
                                                    const Bounds& bounds);

}  // namespace pointfair
