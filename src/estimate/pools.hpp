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

// For each place, the kPool nearest places, itself first. Equal distances go in the order of the places, which is one
// of positions. There must be at least kPool places. O(n^2) at worst; the calls of `for_each` share the work.
class Pools {
 public:
  Pools(const std::vector<Point>& places, const ForEach& for_each);
  // Pools that were found elsewhere, row after row.
  explicit Pools(std::vector<std::uint32_t> rows) : rows_(std::move(rows)) {}
  std::span<const std::uint32_t> of(std::size_t place) const {
    return std::span(rows_).subspan(place * constants::kPool, constants::kPool);
  }

 private:
  std::vector<std::uint32_t> rows_;
};

// The median of the known values of a pool; none where no value is known.
std::optional<double> median_known(std::span<const std::uint32_t> pool, const Ranked& values);

}  // namespace pointfair
