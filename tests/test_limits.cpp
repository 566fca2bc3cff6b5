// SPDX-License-Identifier: Apache-2.0
// Where and how far points may move.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "pointfair/limits.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

Limits limits_of(std::string_view name, std::string_view text) {
  Limits limits;
  set_limit(limits, name, text);
  return limits;
}

TEST(Limits, TextsReadBackTheSame) {
  for (const auto& [name, text] : {std::pair<const char*, const char*>{"strength", "0.25"},
                                   {"box", "-1.5,0,2,1,0.1,1e+30"},
                                   {"lasso", "1,0,0,0,0,1,0,0,0,0,0,1:0,0,1,0,0.5,0.75"}}) {
    const Limits limits = limits_of(name, text);
    EXPECT_EQ(limit_text(limits, name), text);
    EXPECT_EQ(limits_of(name, limit_text(limits, name)), limits);
    EXPECT_NE(limits, Limits{});
  }
  for (const std::string_view name : kLimitNames) EXPECT_EQ(limit_text({}, name), "");
}

TEST(Limits, UnsoundTextsAreRefused) {
  for (const auto& [name, text] : {std::pair<const char*, const char*>{"strength", "1.5"},
                                   {"strength", "-0.1"},
                                   {"strength", "nan"},
                                   {"box", "1,2,3"},
                                   {"box", "1,0,0,0,1,1"},
                                   {"box", "0,0,0,1,1,inf"},
                                   {"box", "0,0,0,1,1,1,"},
                                   {"lasso", "1,2,3"},
                                   {"lasso", "1,0,0,0,0,1,0,0,0,0,0,1:0,0,1,1"},
                                   {"lasso", "1,0,0,0,0,1,0,0,0,0,0,1:0,0,1,0,1"},
                                   {"corner", "1"}}) {
    Limits limits;
    EXPECT_THROW(set_limit(limits, name, text), Error) << name << ' ' << text;
  }
}

TEST(Limits, ABoxIsInFileCoordinatesAndHoldsItsFaces) {
  Cloud cloud;
  cloud.origin = {500000, 0, 0};
  cloud.points = {{0, 0, 0}, {1, 0, 0}, {1.0001f, 0, 0}, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, -0.5f}};
  cloud.points.push_back({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  EXPECT_EQ(movable_points(limits_of("box", "500000,0,0,500001,1,1"), cloud),
            (std::vector<std::uint8_t>{1, 1, 0, 1, 0, 0}));
  EXPECT_TRUE(movable_points({}, cloud).empty());
}

// A camera at z = 5 that looks down: x / w and y / w with w = 5 - z.
TEST(Limits, ALassoSeesThroughItsCamera) {
  const Limits limits = limits_of("lasso", "1,0,0,0,0,1,0,0,0,0,-1,5:-0.1,-0.1,0.1,-0.1,0.1,0.1,-0.1,0.1");
  Cloud cloud;
  cloud.points = {{0, 0, 0}, {0.4f, 0, 0}, {0.6f, 0, 0}, {0.4f, 0, 2}, {0, 0, 6}, {0, 0, 5}};
  EXPECT_EQ(movable_points(limits, cloud), (std::vector<std::uint8_t>{1, 1, 0, 0, 0, 0}));
}

TEST(Limits, AHollowPolygonIsEvenOdd) {
  // a U: the notch between x = -0.5 and 0.5 above y = 0 is outside
  const Limits limits = limits_of("lasso", "1,0,0,0,0,1,0,0,0,0,0,1:-1,-1,1,-1,1,1,0.5,1,0.5,0,-0.5,0,-0.5,1,-1,1");
  Cloud cloud;
  cloud.points = {{0, -0.5f, 0}, {0, 0.5f, 0}, {0.75f, 0.5f, 0}, {-0.75f, 0.9f, 0}, {0, 1.5f, 0}};
  EXPECT_EQ(movable_points(limits, cloud), (std::vector<std::uint8_t>{1, 0, 1, 1, 0}));
}

TEST(Limits, OutsideKeepsItsBitsAndStrengthGoesPartOfTheWay) {
  Cloud before, after;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  before.points = {{0, 0, 0}, {2, 0, 0}, {nan, 1, 0}};
  after.points = {{0, 0, 1}, {2, 0, 1}, {nan, 1, 0}};
  Limits limits = limits_of("box", "-1,-1,-1,1,1,1");
  limits.strength = 0.25;
  apply_limits(limits, before, after);
  EXPECT_EQ(after.points[0].z, 0.25f);
  EXPECT_EQ(std::memcmp(&after.points[1], &before.points[1], sizeof(Point)), 0);
  EXPECT_EQ(std::memcmp(&after.points[2], &before.points[2], sizeof(Point)), 0);
  after.points.pop_back();
  EXPECT_THROW(apply_limits(limits, before, after), Error);
}

}  // namespace
}  // namespace pointfair
