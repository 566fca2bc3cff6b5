// SPDX-License-Identifier: Apache-2.0
// Samples that stand for a place together, since one alone says little of it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/ranked.hpp"
#include "point/sample.h"
#include "pointfair/cloud.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {

// Samples that show noise, each at its place. `residuals` may be empty: none is looked at.
struct LocalSamples {
  std::vector<Point> places;
  std::vector<point::NoiseSample> noise;
  std::vector<point::ResidualSample> residuals;
};

// The kPool nearest of some places to each of them, itself first, found along x; equal distances in the order of the
// places, which is one of positions. At least kPool places. O(n^2) at worst, by all that `for_each` calls at once.
class Pools {
 public:
  Pools(const std::vector<Point>& places, const ForEach& for_each);
  // As they were found otherwise, row after row.
  explicit Pools(std::vector<std::uint32_t> rows) : rows_(std::move(rows)) {}
  std::span<const std::uint32_t> of(std::size_t place) const {
    return std::span(rows_).subspan(place * constants::kPool, constants::kPool);
  }

 private:
  std::vector<std::uint32_t> rows_;
};

// Of the values at those places of a pool where one is known; NaN is none.
std::optional<double> median_known(std::span<const std::uint32_t> pool, const Ranked& values);

}  // namespace pointfair
