// SPDX-License-Identifier: Apache-2.0
#include "tiles/halves.hpp"

#include <algorithm>

namespace pointfair {
namespace {

constexpr float Point::*kAxes[] = {&Point::x, &Point::y, &Point::z};

int longest_axis(const Bounds& b) {
  int axis = 0;
  for (int a = 1; a < 3; ++a)
    if (b.max.*kAxes[a] - b.min.*kAxes[a] > b.max.*kAxes[axis] - b.min.*kAxes[axis]) axis = a;
  return axis;
}

}  // namespace

std::optional<Halves> halve(std::span<Point> sample, std::size_t parts) {
  Bounds extent = kNoBounds;
  for (const Point& p : sample) include(extent, p);
  const int axis = longest_axis(extent);
  const auto coordinate = kAxes[axis];
  if (parts == 1 || sample.size() < 2 || !(extent.max.*coordinate > extent.min.*coordinate)) return std::nullopt;
  const std::size_t left_parts = parts / 2;
  const auto middle = sample.begin() + std::ptrdiff_t(sample.size() * left_parts / parts);
  std::nth_element(sample.begin(), middle, sample.end(),
                   [&](const Point& a, const Point& b) { return a.*coordinate < b.*coordinate; });
  float plane = (*middle).*coordinate;
  if (!(plane > extent.min.*coordinate)) {  // many share the least coordinate: they make the left part
    plane = extent.max.*coordinate;
    for (const Point& p : sample)
      if (p.*coordinate > extent.min.*coordinate) plane = std::min(plane, p.*coordinate);
  }
  const auto bound =
      std::partition(sample.begin(), sample.end(), [&](const Point& p) { return p.*coordinate < plane; });
  const auto left = std::size_t(bound - sample.begin());
  return Halves{axis, plane, sample.first(left), sample.subspan(left), left_parts};
}

std::array<std::vector<std::uint32_t>, 2> halves_of(std::vector<std::uint32_t> some, std::span<const Point> points,
                                                    const Bounds& bounds) {
  const auto axis = kAxes[longest_axis(bounds)];
  const double plane = (double(bounds.min.*axis) + bounds.max.*axis) / 2;
  const auto right =
      std::stable_partition(some.begin(), some.end(), [&](std::uint32_t i) { return double(points[i].*axis) < plane; });
  return {std::vector(some.begin(), right), std::vector(right, some.end())};
}

}  // namespace pointfair
