// SPDX-License-Identifier: Apache-2.0
#include "io/las/summary.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace pointfair::io::las {
namespace {

// Whether the header's bounds are numbers and hold all points, up to what rounding the doubles costs.
bool are_right(const Scaling& scaling, const GridBounds& bounds, std::string_view front) {
  constexpr double kRounding = 1e-6;  // of a step
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto max = get<double>(front, place::bounds + 16 * axis),
               min = get<double>(front, place::bounds + 16 * axis + 8);
    const double slack = kRounding * scaling.scale[axis];
    if (!std::isfinite(min) || !std::isfinite(max) || scaling.value(axis, bounds.max[axis]) > max + slack ||
        scaling.value(axis, bounds.min[axis]) < min - slack)
      return false;
  }
  return true;
}

// Takes the points that are gone off a number in the header. One that was wrong does not fall below 0.
template <class T>
void take_off(std::string& front, std::size_t at, std::uint64_t gone) {
  const T before = get<T>(front, at);
  put(front, at, static_cast<T>(before - std::min<std::uint64_t>(before, gone)));
}

}  // namespace

void put_bounds(const Scaling& scaling, const GridBounds& before, const GridBounds& now, std::string& front) {
  const bool all = !are_right(scaling, before, front);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t at = place::bounds + 16 * axis;
    if (all || now.max[axis] != before.max[axis]) put(front, at, scaling.value(axis, now.max[axis]));
    if (all || now.min[axis] != before.min[axis]) put(front, at + 8, scaling.value(axis, now.min[axis]));
  }
}

void take_off_counts(const ReturnCounts& gone, std::uint64_t points, const Header& header, std::string& front) {
  constexpr std::size_t kLegacyReturns = 5, kReturns = 15, kFullHeader = 375;
  take_off<std::uint32_t>(front, place::legacy_count, points);
  for (std::size_t r = 0; r < kLegacyReturns; ++r)
    take_off<std::uint32_t>(front, place::legacy_returns + 4 * r, gone[r + 1]);
  if (header.minor < 4 || header.size < kFullHeader) return;
  take_off<std::uint64_t>(front, place::count, points);
  for (std::size_t r = 0; r < kReturns; ++r) take_off<std::uint64_t>(front, place::returns + 8 * r, gone[r + 1]);
}

}  // namespace pointfair::io::las
