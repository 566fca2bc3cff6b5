// SPDX-License-Identifier: Apache-2.0
// Divides a sample of a cloud at a plane, for trees that follow any density.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "pointfair/cloud.hpp"

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

}  // namespace pointfair
