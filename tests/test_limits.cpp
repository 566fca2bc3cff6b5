// SPDX-License-Identifier: Apache-2.0
// Where and how far points may move.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "pointfair/limits.hpp"
#include "pointfair/pipeline.hpp"
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
                                   {"lasso", "1,0,0,0,0,1,0,0,0,0,0,1:0,0,1,0,0.5,0.75"},
                                   {"where", "classification=2,6,64-255"},
                                   {"ignore", "a=-5--3,0;b c=7"}}) {
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
                                   {"where", "classification"},
                                   {"where", "=2"},
                                   {"where", "classification=2.5"},
                                   {"where", "classification=6-2"},
                                   {"where", "classification=2,"},
                                   {"where", "classification=2;;"},
                                   {"ignore", "classification=ground"},
                                   {"ignore", "classification=99999999999999999999"},
                                   {"corner", "1"}}) {
    Limits limits;
    EXPECT_THROW(set_limit(limits, name, text), Error) << name << ' ' << text;
  }
}

TEST(Limits, ABoxIsInFileCoordinatesAndHoldsItsFaces) {
  Cloud cloud{.origin = {500000, 0, 0},
              .points = {{0, 0, 0}, {1, 0, 0}, {1.0001f, 0, 0}, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, -0.5f}}};
  cloud.points.push_back({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  EXPECT_EQ(movable_points(limits_of("box", "500000,0,0,500001,1,1"), cloud),
            (std::vector<std::uint8_t>{1, 1, 0, 1, 0, 0}));
  EXPECT_TRUE(movable_points({}, cloud).empty());
}

// A camera at z = 5 that looks down: x / w and y / w with w = 5 - z.
TEST(Limits, ALassoSeesThroughItsCamera) {
  const Limits limits = limits_of("lasso", "1,0,0,0,0,1,0,0,0,0,-1,5:-0.1,-0.1,0.1,-0.1,0.1,0.1,-0.1,0.1");
  EXPECT_EQ(
      movable_points(limits, {.points = {{0, 0, 0}, {0.4f, 0, 0}, {0.6f, 0, 0}, {0.4f, 0, 2}, {0, 0, 6}, {0, 0, 5}}}),
      (std::vector<std::uint8_t>{1, 1, 0, 0, 0, 0}));
}

TEST(Limits, AHollowPolygonIsEvenOdd) {
  // a U: the notch between x = -0.5 and 0.5 above y = 0 is outside
  const Limits limits = limits_of("lasso", "1,0,0,0,0,1,0,0,0,0,0,1:-1,-1,1,-1,1,1,0.5,1,0.5,0,-0.5,0,-0.5,1,-1,1");
  EXPECT_EQ(movable_points(
                limits, {.points = {{0, -0.5f, 0}, {0, 0.5f, 0}, {0.75f, 0.5f, 0}, {-0.75f, 0.9f, 0}, {0, 1.5f, 0}}}),
            (std::vector<std::uint8_t>{1, 0, 1, 1, 0}));
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

// A wavy sheet whose points have the classes 2, 6 and 7 in turn.
Cloud classified() {
  Cloud cloud{.points = shapes::with_noise(shapes::waves(900), 0.01)};
  Attribute& classes = cloud.added.emplace_back();
  classes.name = "classification";
  classes.type = ScalarType::uint8;
  for (std::size_t i = 0; i < cloud.points.size(); ++i)
    classes.data.push_back(std::byte{i % 3 == 0 ? std::uint8_t{2} : i % 3 == 1 ? std::uint8_t{6} : std::uint8_t{7}});
  return cloud;
}

TEST(Limits, ZerosThatStayKeepTheirSigns) {
  const Cloud before{.points = {{-0.0F, 1, -0.0F}, {0.0F, -0.0F, 2}}};
  for (const char* const strength : {"0", "0.5"}) {
    Cloud after{.points = {{0.0F, 2, 0.0F}, {0.0F, 0.0F, 3}}};
    apply_limits(limits_of("strength", strength), before, after);
    EXPECT_TRUE(std::signbit(after.points[0].x) && std::signbit(after.points[0].z));
    EXPECT_TRUE(!std::signbit(after.points[1].x) && std::signbit(after.points[1].y));
    EXPECT_EQ(after.points[1].z, strength[1] == '.' ? 2.5F : 2.0F);
  }
}

TEST(Limits, WhereAllOfSeveralHoldPointsMove) {
  const Cloud cloud = classified();
  EXPECT_EQ(movable_points(limits_of("where", "classification=2"), cloud)[0], 1);
  EXPECT_EQ(movable_points(limits_of("where", "classification=2"), cloud)[1], 0);
  EXPECT_EQ(movable_points(limits_of("where", "classification=0-2,6"), cloud)[1], 1);
  EXPECT_EQ(movable_points(limits_of("where", "classification=2,6;classification=6-9"), cloud)[0], 0);
  EXPECT_EQ(movable_points(limits_of("where", "classification=2,6;classification=6-9"), cloud)[1], 1);
  EXPECT_EQ(movable_points(limits_of("ignore", "classification=7"), cloud)[2], 0);
  EXPECT_EQ(movable_points(limits_of("ignore", "classification=7"), cloud)[1], 1);
  EXPECT_THROW(movable_points(limits_of("where", "class=2"), cloud), Error);
  EXPECT_THROW(without_ignored(limits_of("ignore", "class=2"), cloud), Error);
}

TEST(Limits, AMaskHoldsOneValueForEachPoint) {
  const Cloud cloud = classified();
  Limits limits;
  limits.mask.assign(cloud.points.size(), 1);
  limits.mask[3] = 0;
  EXPECT_EQ(movable_points(limits, cloud), limits.mask);
  set_limit(limits, "where", "classification=2");
  EXPECT_EQ(movable_points(limits, cloud)[3], 0);
  EXPECT_EQ(movable_points(limits, cloud)[0], 1);
  EXPECT_EQ(movable_points(limits, cloud)[1], 0);
  limits.mask.pop_back();
  EXPECT_THROW(movable_points(limits, cloud), Error);
}

// Oracle: a cloud that never had the ignored points.
TEST(Limits, IgnoredPointsKeepTheirPlaceAndAreNobodysNeighbours) {
  const Cloud cloud = classified();
  const Limits limits = limits_of("ignore", "classification=7");
  Pipeline pipeline(Device::cpu);
  pipeline.load(without_ignored(limits, cloud));
  Cloud denoised = pipeline.run();
  apply_limits(limits, cloud, denoised);
  Cloud others;
  for (std::size_t i = 0; i < cloud.points.size(); ++i)
    if (i % 3 != 2) others.points.push_back(cloud.points[i]);
  pipeline.load(others);
  others = pipeline.run();
  std::size_t next = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Point& expected = i % 3 == 2 ? cloud.points[i] : others.points[next++];
    EXPECT_EQ(std::memcmp(&denoised.points[i], &expected, sizeof(Point)), 0) << i;
  }
}

}  // namespace
}  // namespace pointfair
