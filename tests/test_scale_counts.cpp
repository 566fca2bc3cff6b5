// SPDX-License-Identifier: Apache-2.0
// What a run in tiles counts while it writes: each point once.
#include <gtest/gtest.h>

#include <vector>

#include "scale/counted_ranges.hpp"

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

}  // namespace
}  // namespace pointfair::scale
