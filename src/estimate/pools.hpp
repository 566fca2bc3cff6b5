// SPDX-License-Identifier: Apache-2.0
// Samples that stand for a place together, since one alone says little of it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "estimate/constants.hpp"
#include "point/sample.h"
#include "pointfair/cloud.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {

// Samples that show noise, each at its place, and its pool: the kPool nearest places, itself first.
struct LocalSamples {
  std::vector<Point> places;
  std::vector<point::NoiseSample> noise;
  std::vector<point::ResidualSample> residuals;
  std::vector<std::uint32_t> pools;  // row after row

  std::span<const std::uint32_t> pool(std::size_t place) const {
    return std::span(pools).subspan(place * constants::kPool, constants::kPool);
  }
  // The nearest of them.
  std::span<const std::uint32_t> near(std::size_t place) const { return pool(place).first(constants::kSmoothed); }
};

// The pools of at least kPool places. Equal distances go in the order of the places, which is one of positions. O(n^2)
// at worst; the calls of `for_each` share the work.
std::vector<std::uint32_t> pools_of(const std::vector<Point>& places, const ForEach& for_each);

// Calls body(i) for each of `count` places, many at once, but not few on another thread: these are done sooner than it
// wakes.
template <class Body>
void for_places(std::size_t count, const ForEach& for_each, const Body& body) {
  constexpr std::size_t kTogether = 128;
  for_each((count + kTogether - 1) / kTogether, [&](std::size_t block) {
    for (std::size_t i = block * kTogether; i < std::min(count, (block + 1) * kTogether); ++i) body(i);
  });
}

// The median of the values of a pool that are no NaN; NaN where all are.
double median_known(std::span<const std::uint32_t> pool, const std::vector<double>& values);

}  // namespace pointfair
