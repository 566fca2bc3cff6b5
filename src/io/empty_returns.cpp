// SPDX-License-Identifier: Apache-2.0
#include "io/empty_returns.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "portable.hpp"

namespace pointfair::io {
namespace {

// Of the median distance from the origin. Where a surface goes through the origin, a sixteenth of the points or so is
// nearer, and of a solid a sixty-fourth: far more than copies of one point. A lidar has next to none there.
constexpr double kNear = 0.25;

}  // namespace

void EmptyReturns::take(std::span<const Position> positions) {
  for (const Position& p : positions) {
    if (p == Position{}) {
      ++zeros_;
    } else if (std::isfinite(p[0] + p[1] + p[2])) {
      ++finite_;
      others_.offer(p);
    }
  }
}

bool EmptyReturns::are_empty() && {
  if (zeros_ < 2 || finite_ == 0) return false;
  std::vector<double> distances;
  for (const Position& p : std::move(others_).take()) distances.push_back(portable::hypot(p[0], p[1], p[2]));
  const auto middle = distances.begin() + std::ptrdiff_t(distances.size() / 2);
  std::ranges::nth_element(distances, middle);
  const double near = kNear * *middle;
  const auto others = std::ranges::count_if(distances, [near](double distance) { return distance < near; });
  return double(zeros_) * double(distances.size()) > double(others) * double(finite_);
}

}  // namespace pointfair::io
