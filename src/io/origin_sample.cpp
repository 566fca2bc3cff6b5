// SPDX-License-Identifier: Apache-2.0
#include "io/origin_sample.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>

#include "portable.hpp"

namespace pointfair::io {
namespace {

// A quarter of the extent, as a power of two: subtracting such a number from a float of this size is exact.
double rounding_step(double extent) { return portable::power_of_two_below(extent) / 4; }

struct Range {
  double low, high;
};

// The middle nine tenths, so that a stray point (or a zero written for "no return") does not hide large coordinates.
std::optional<Range> bulk_range(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  const std::size_t low = values.size() / 20, high = values.size() - 1 - low;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(low), values.end());
  const double smallest = values[low];
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(high), values.end());
  return Range{smallest, values[high]};
}

// Float offsets from 0 have log2(2 size / extent) bits less than those from the middle; up to 3 are given away, since
// nearly all clouds of floats then stay as they are.
constexpr double kLarge = 4;

// Whether no axis has coordinates that are large against the extent, as far as that shows without quantiles; false: one
// may have. Where more than a twentieth of the values lie in the lowest quarter of their range and in the highest, the
// bulk reaches from one to the other.
bool is_surely_small(const std::vector<Position>& sample) {
  BoxOf<double> box;
  for (const Position& p : sample) box.add(p);
  const auto& [least, most] = box;
  Position low, high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double quarter = (most[axis] - least[axis]) / 4;
    low[axis] = least[axis] + quarter;
    high[axis] = most[axis] - quarter;
  }
  std::array<std::size_t, 3> lows{}, highs{};
  for (const Position& p : sample)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lows[axis] += p[axis] <= low[axis];
      highs[axis] += p[axis] >= high[axis];
    }
  double size = 0, least_extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (std::min(lows[axis], highs[axis]) > sample.size() / 20)
      least_extent = std::max(least_extent, high[axis] - low[axis]);
    size = std::max({size, std::abs(least[axis]), std::abs(most[axis])});
  }
  return least_extent > 0 && size <= kLarge * least_extent;
}

}  // namespace

// Its words are mixed as in the 64-bit MurmurHash3 (A. Appleby).
void OriginSample::offer(const Position& p) {
  std::uint64_t hash = 0x9e3779b97f4a7c15u;
  for (const double c : p) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(c + 0.0)) * 0xff51afd7ed558ccdu;
    hash ^= hash >> 33;
  }
  if (hash * 0xc4ceb9fe1a85ec53u <= limit_) chosen_.push_back(p);
  if (std::isfinite(p[0] + p[1] + p[2])) box_.add(p);
}

void OriginSample::offer_all(const OriginSample& other) {
  chosen_.insert(chosen_.end(), other.chosen_.begin(), other.chosen_.end());
  box_.add(other.box_);
}

std::vector<Position> OriginSample::state() const {
  std::vector<Position> all = chosen_;
  all.insert(all.end(), {box_.min, box_.max});
  return all;
}

void OriginSample::offer_state(const std::vector<Position>& state) {
  OriginSample other(0);
  other.chosen_.assign(state.begin(), state.end() - 2);
  other.box_.add(state[state.size() - 2], state.back());
  offer_all(other);
}

// Many points at few places may all have a hash beyond the limit; then the corners of their box.
std::vector<Position> OriginSample::take() && {
  constexpr std::size_t kFew = 64;
  if (chosen_.size() < kFew && limit_ != ~std::uint64_t{0}) return {box_.min, box_.max};
  return std::move(chosen_);
}

Position choose_origin(std::vector<Position> sample) {
  std::erase_if(sample, [](const Position& p) { return !std::isfinite(p[0] + p[1] + p[2]); });
  if (is_surely_small(sample)) return {};
  std::array<std::optional<Range>, 3> ranges;
  double extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values(sample.size());
    std::ranges::transform(sample, values.begin(), [axis](const Position& p) { return p[axis]; });
    ranges[axis] = bulk_range(std::move(values));
    if (ranges[axis]) extent = std::max(extent, ranges[axis]->high - ranges[axis]->low);
  }
  Position origin{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!ranges[axis]) continue;
    const auto [low, high] = *ranges[axis];
    const double size = std::max(std::abs(low), std::abs(high));
    const double centre = low + (high - low) / 2;
    if (extent == 0 && static_cast<double>(static_cast<float>(low)) == low) continue;
    const double width = extent == 0 ? 4 : extent;
    if (!(size > kLarge * width)) continue;
    const double step = rounding_step(width);
    const double rounded = std::nearbyint(centre / step) * step;
    if (std::isfinite(rounded)) origin[axis] = rounded;
  }
  return origin;
}

}  // namespace pointfair::io
