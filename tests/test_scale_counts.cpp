// SPDX-License-Identifier: Apache-2.0
// What a run in tiles counts while it writes: each point once, and how far it moved.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "scale/counted_ranges.hpp"
#include "scale/move_tally.hpp"

namespace pointfair::scale {
namespace {

TEST(ScaleCounts, a_range_that_is_taken_again_has_nothing_new) {
  CountedRanges ranges;
  using Ranges = std::vector<Range>;
  EXPECT_EQ(ranges.take({10, 20}), (Ranges{{10, 20}}));
  EXPECT_EQ(ranges.take({10, 20}), Ranges{});
  EXPECT_EQ(ranges.take({12, 15}), Ranges{});
  EXPECT_EQ(ranges.take({20, 30}), (Ranges{{20, 30}}));
  EXPECT_EQ(ranges.take({40, 50}), (Ranges{{40, 50}}));
  EXPECT_EQ(ranges.take({5, 60}), (Ranges{{5, 10}, {30, 40}, {50, 60}}));
  EXPECT_EQ(ranges.take({0, 70}), (Ranges{{0, 5}, {60, 70}}));
  EXPECT_EQ(ranges.take({0, 0}), Ranges{});
}

TEST(ScaleCounts, moves_that_are_tallied_in_parts_have_the_statistics_of_all) {
  std::mt19937 generator(5);
  std::lognormal_distribution<float> length(-4, 1.5);
  std::vector<float> lengths(20000);
  for (std::size_t i = 0; i < lengths.size(); ++i) lengths[i] = i % 9 == 0 ? 0.0f : length(generator);
  MoveTally one, other, both;
  one.add(std::span(lengths).first(7000));
  other.add(std::span(lengths).subspan(7000));
  both.add_numbers(other.numbers());
  both.add_numbers(one.numbers());
  double sum = 0, squares = 0;
  for (const double value : lengths) sum += value, squares += value * value;
  std::sort(lengths.begin(), lengths.end());
  const Displacement found = both.displacement();
  EXPECT_NEAR(found.mean, sum / 20000, 1e-9 * found.mean);
  EXPECT_NEAR(found.rms, std::sqrt(squares / 20000), 1e-5 * found.rms);
  EXPECT_NEAR(found.p95, lengths[18999], 0.01 * found.p95);
  EXPECT_EQ(found.max, lengths.back());
  EXPECT_EQ(MoveTally().displacement().mean, 0);
}

}  // namespace
}  // namespace pointfair::scale
