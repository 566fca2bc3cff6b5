// SPDX-License-Identifier: Apache-2.0
#include "io/empty_returns.hpp"

#include <algorithm>
#include <cmath>

#include "portable.hpp"

namespace pointfair::io {
namespace {

constexpr std::uint64_t kSample = 8192;  // points; some hundred lie near where a surface goes through the origin
// Of the median distance from the origin. Where a surface goes through the origin, a sixteenth of the points or so is
// nearer, and of a solid a sixty-fourth: far more than copies of one point. A lidar has next to none there.
constexpr double kNear = 0.25;

}  // namespace

EmptyReturns::EmptyReturns(std::uint64_t points) : step_(std::max<std::uint64_t>(1, points / kSample)) {}

void EmptyReturns::take(std::uint64_t first, std::span<const Position> positions) {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Position& p = positions[i];
    if (p == Position{}) {
      ++zeros_;
    } else if ((first + i) % step_ == 0) {
      const double distance = portable::hypot(p[0], p[1], p[2]);
      if (std::isfinite(distance)) distances_.push_back(distance);
    }
  }
}

bool EmptyReturns::are_empty() const {
  if (zeros_ < 2 || distances_.empty()) return false;
  std::vector<double> sorted = distances_;
  const auto middle = sorted.begin() + std::ptrdiff_t(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  const double near = kNear * *middle;
  const auto others = std::ranges::count_if(distances_, [near](double distance) { return distance < near; });
  return zeros_ > static_cast<std::uint64_t>(others) * step_;
}

}  // namespace pointfair::io
