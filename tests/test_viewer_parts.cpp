// SPDX-License-Identifier: Apache-2.0
// The viewer's order of points, encodings, preview patches, gate and recipes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <set>

#include "shapes.h"
#include "viewer/attributes.hpp"
#include "viewer/gate.hpp"
#include "viewer/order.hpp"
#include "viewer/preview.hpp"
#include "viewer/quantise.hpp"
#include "viewer/recipe.hpp"

namespace pointfair::viewer {
namespace {

TEST(ViewerOrder, HoldsEveryPointOnceAndKnowsItsPlace) {
  for (const std::uint64_t n : {1u, 2u, 3u, 4u, 5u, 8u, 13u, 100u, 1000u, 65536u, 99991u}) {
    const Order order(n);
    std::vector<bool> seen(n);
    for (std::uint64_t place = 0; place < n; ++place) {
      const std::uint32_t index = order.index(place);
      ASSERT_LT(index, n);
      EXPECT_FALSE(seen[index]) << n;
      seen[index] = true;
      EXPECT_EQ(order.next(index), order.index(place + 1)) << n;
      EXPECT_EQ(order.place(index), place) << n;
    }
  }
}

TEST(ViewerOrder, FirstPartsAreSpreadEvenly) {
  constexpr std::uint64_t n = 100000, first = 1000, parts = 50;
  const Order order(n);
  std::vector<int> counts(parts);
  for (std::uint64_t place = 0; place < first; ++place) ++counts[order.index(place) * parts / n];
  for (const int count : counts) EXPECT_NEAR(count, int(first / parts), 3);
}

TEST(ViewerOrder, TheLargestCloudDoesNotOverflow) {
  const std::uint64_t n = 0xfffffff0u;
  const Order order(n);
  for (const std::uint64_t place : {std::uint64_t{0}, std::uint64_t{1}, n / 2, n - 1})
    EXPECT_EQ(order.place(order.index(place)), place);
}

TEST(ViewerAttributes, ColoursAreOfferedAsColoursWhateverTheirNames) {
  const std::array<const char*, 3> named[] = {
      {"red", "green", "blue"}, {"r", "g", "b"}, {"colorRed", "colorGreen", "colorBlue"}};
  for (const auto& names : named) {
    Cloud cloud{.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    for (std::size_t c = 0; c < 3; ++c) {
      Attribute& channel = cloud.added.emplace_back();
      channel.name = names[c];
      channel.type = ScalarType::uint8;
      for (std::size_t i = 0; i < 3; ++i) channel.data.push_back(std::byte(10 * i + c));
    }
    EXPECT_EQ(colour_choices(cloud), Json::parse(R"([{"name": "rgb", "kind": "rgb"}])"));
    const Order order(3);
    const std::vector<std::uint8_t> shown = colours(cloud, order, 3);
    for (std::size_t place = 0; place < 3; ++place)
      for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(shown[4 * place + c], 10 * order.index(place) + c);
  }
}

TEST(ViewerQuantise, NormalsComeBackWithinATenThousandth) {
  std::mt19937 random(3);
  std::normal_distribution<float> gauss;
  for (int i = 0; i < 20000; ++i) {
    Point n{gauss(random), gauss(random), gauss(random)};
    if (i < 6) {  // the axes, both ways
      n = {0, 0, 0};
      (&n.x)[i / 2] = i % 2 == 0 ? 1.f : -1.f;
    }
    const float length = std::hypot(n.x, n.y, n.z);
    n = {n.x / length, n.y / length, n.z / length};
    const Point back = decode_normal(encode_normal(n));
    EXPECT_LT(std::hypot(back.x - n.x, back.y - n.y, back.z - n.z), 1e-4);
  }
  const Point none = decode_normal(encode_normal({0, 0, 0}));
  EXPECT_EQ(std::abs(none.x) + std::abs(none.y) + std::abs(none.z), 0);
}

TEST(ViewerQuantise, WhatStepsCannotSayIsSentAsItIs) {
  const std::vector<Point> before(1000, Point{0, 0, 0});
  std::vector<Point> after = before;
  for (std::size_t i = 0; i < after.size(); ++i) after[i].z = 0.001f * float(i % 7);
  after[10] = {0.5f, 0, 0};  // across its normal
  after[20] = {0, 0, 5000};  // farther than 16 bits reach
  const Order order(before.size());
  const std::vector<std::int16_t> normals = encode_normals(std::vector<Point>(1000, Point{0, 0, 1}), order, 1000);
  const float step = displacement_step(0.1, 10);
  const Displacements moved = encode_displacements(before, after, order, 1000, normals, step);
  EXPECT_TRUE(moved.along_normals);
  ASSERT_EQ(moved.places.size(), 2u);
  for (std::size_t e = 0; e < 2; ++e) {
    const Point& wanted = after[order.index(moved.places[e])];
    EXPECT_NEAR(moved.exceptions[3 * e], wanted.x, 1e-6);
    EXPECT_NEAR(moved.exceptions[3 * e + 2], wanted.z, 1e-6 * std::abs(wanted.z));
  }
  EXPECT_NEAR(moved.max, 5000, 1e-3);
}

TEST(ViewerQuantise, MostLengthsAreBelowTheNinetyFifthPercentile) {
  const std::vector<Point> before(10000, Point{0, 0, 0});
  std::vector<Point> after = before;
  for (std::size_t i = 0; i < after.size(); ++i) after[i].x = float(i);  // lengths 0 to 9999
  after[9999].x = std::numeric_limits<float>::quiet_NaN();
  const Order order(before.size());
  const float step = displacement_step(1, 10000);
  EXPECT_NEAR(encode_displacements(before, after, order, 10000, {}, step).p95, 9500, 20);
  const std::vector<Point> few(before.begin(), before.begin() + 100);
  EXPECT_EQ(
      encode_displacements(few, std::vector<Point>(after.begin(), after.begin() + 100), Order(100), 100, {}, step).p95,
      95);
  EXPECT_EQ(encode_displacements({}, {}, Order(0), 0, {}, step).p95, 0);
}

TEST(ViewerQuantise, TangentialMotionTakesSixBytes) {
  const std::vector<Point> before(1000, Point{0, 0, 0}), after(1000, Point{0.3f, 0.1f, 0});
  const Order order(before.size());
  const std::vector<std::int16_t> normals = encode_normals(std::vector<Point>(1000, Point{0, 0, 1}), order, 1000);
  const Displacements moved = encode_displacements(before, after, order, 1000, normals, displacement_step(0.1, 10));
  EXPECT_FALSE(moved.along_normals);
  EXPECT_TRUE(moved.places.empty());
  EXPECT_NEAR(moved.mean, std::hypot(0.3, 0.1), 1e-6);
}

TEST(ViewerPreview, APatchHoldsTheNearestPoints) {
  const std::vector<Point> points = shapes::waves(20000);
  const Point center = points[777];
  const Patch patch = cut_patch(points, center, 1000);
  EXPECT_GT(patch.indices.size(), 800u);
  EXPECT_LT(patch.indices.size(), 1200u);
  const std::set<std::uint32_t> inside(patch.indices.begin(), patch.indices.end());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const double d = std::hypot(points[i].x - center.x, points[i].y - center.y, points[i].z - center.z);
    if (std::abs(d / patch.radius - 1) > 0.001) {
      EXPECT_EQ(inside.count(i) == 1, d < patch.radius) << i;
    }
  }
}

TEST(ViewerPreview, APatchOfDenseOrIdenticalPointsStaysSmall) {
  std::vector<Point> points = shapes::waves(50000);
  for (std::size_t i = 0; i < 20000; ++i) points.push_back({0, 0, 0});
  EXPECT_LE(cut_patch(points, {0, 0, 0}, 1000).indices.size(), 2000u);
  EXPECT_EQ(cut_patch(points, {0, 0, 0}, 1000000).indices.size(), points.size());
  EXPECT_TRUE(cut_patch({}, {0, 0, 0}, 10).indices.empty());
}

TEST(ViewerGate, AdmitsItsOwnNamesOnly) {
  const Gate gate{{"localhost", "127.0.0.1", "[::1]"}, ""};
  for (const char* host : {"localhost", "localhost:8080", "127.0.0.1:1", "[::1]", "[::1]:99", "LOCALHOST:80"})
    EXPECT_TRUE(gate.admits_host(host)) << host;
  for (const char* host :
       {"", ":80", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example:80", "[::2]:80", "[", "10.0.0.1"})
    EXPECT_FALSE(gate.admits_host(host)) << host;
}

TEST(ViewerGate, AdmitsPagesOfItsOwnAddressOnly) {
  const Gate gate{{"localhost"}, ""};
  EXPECT_TRUE(gate.admits_origin("http://localhost:8080", "localhost:8080"));
  for (const char* origin : {"", "null", "http://localhost", "http://localhost:8081", "http://evil.example",
                             "localhost:8080", "http://localhost:8080.evil.example", "file://"})
    EXPECT_FALSE(gate.admits_origin(origin, "localhost:8080")) << origin;
}

TEST(ViewerGate, AsksForTheWholeToken) {
  const Gate gate{{}, make_token()};
  EXPECT_EQ(gate.token.size(), 32u);
  EXPECT_NE(gate.token, make_token());
  EXPECT_TRUE(gate.admits_target("/session?token=" + gate.token));
  EXPECT_TRUE(gate.admits_target("/upload?name=a.ply&token=" + gate.token));
  for (const std::string& target :
       {std::string("/session"), std::string("/session?token="), "/session?token=" + gate.token.substr(1),
        "/session?token=" + gate.token + "0", "/session?notoken=" + gate.token})
    EXPECT_FALSE(gate.admits_target(target)) << target;
}

TEST(ViewerGate, DecodesQueries) {
  EXPECT_EQ(query_value("/u?name=a%20b%2Fc.ply&x=1", "name"), "a b/c.ply");
  EXPECT_EQ(query_value("/u?name=%zz%4", "name"), "%zz%4");
  EXPECT_EQ(query_value("/u", "name"), "");
  EXPECT_EQ(path_of("/a/b?c=/d"), "/a/b");
}

TEST(ViewerRecipe, EveryParameterIsDescribedAndReadsBack) {
  const Json rows = describe_params();
  ASSERT_EQ(rows.size(), kParams.size());
  for (const Json& row : rows) {
    const Json message{{"params", {{row["name"].get<std::string>(), row["default"]}}}};
    EXPECT_EQ(read_recipe(message), Recipe{}) << row;
    for (const Json& word : row["values"]) {
      const bool reads_faces = word == "fleishman" || word == "jones";
      Json params = {{"k", "auto"}, {"connectivity", reads_faces ? "mesh" : "points"}};
      params[row["name"].get<std::string>()] = word;
      EXPECT_NO_THROW(read_recipe({{"params", params}})) << word;
    }
  }
}

TEST(ViewerRecipe, TheCommandNamesWhatDiffersAndQuotesForTheShell) {
  Recipe recipe;
  recipe.params.k = 24;
  recipe.params.radius = {0.5, Length::Unit::percent};
  recipe.limits.strength = 0.25;
  const std::string command = as_command(recipe, {"/data/my 'scan'.ply", "denoised.ply", "ascii", Device::cpu});
  EXPECT_EQ(
      command,
      R"(pointfair run '/data/my '\''scan'\''.ply' denoised.ply --k=24 --radius=0.5% --strength=0.25 --encoding=ascii --device=cpu)");
  EXPECT_EQ(as_command({}, {"-", "-x.ply", "", Device::cuda}), "pointfair run ./- ./-x.ply --device=cuda");
}

TEST(ViewerRecipe, AMethodIsNamedInTheCommandAndInTheProgram) {
  const Recipe recipe = read_recipe({{"params", {{"method", "hc-laplacian"}}}});
  EXPECT_EQ(recipe.params.method, Method::hc_laplacian);
  const Errand errand{"a.ply", "b.ply", "", Device::cpu};
  EXPECT_EQ(as_command(recipe, errand), "pointfair run a.ply b.ply --method=hc-laplacian --device=cpu");
  EXPECT_NE(as_cpp(recipe, errand).find(R"(set_param(params, *pointfair::find_param("method"), "hc-laplacian");)"),
            std::string::npos);
}

TEST(ViewerRecipe, CommandAndProgramReadTheFileAsItWasRead) {
  Errand errand{"a.txt", "b.ply", "", Device::cpu};
  errand.reading = {.columns = {"id", "x", "y", "z"}, .skip_lines = 2};
  EXPECT_EQ(as_command({}, errand), "pointfair run a.txt b.ply --columns=id,x,y,z --skip=2 --device=cpu");
  EXPECT_NE(as_cpp({}, errand).find(R"(read("a.txt", {.columns = {"id", "x", "y", "z"}, .skip_lines = 2}))"),
            std::string::npos);
  errand.reading = {.format = Format::nuscenes};
  EXPECT_EQ(as_command({}, errand), "pointfair run a.txt b.ply --in-format=nuscenes --device=cpu");
  EXPECT_NE(as_cpp({}, errand).find(R"(read("a.txt", {.format = pointfair::Format::nuscenes}))"), std::string::npos);
}

TEST(ViewerRecipe, TheProgramEscapesNames) {
  const std::string program = as_cpp({}, {"a\"b\\c\n.ply", "denoised.ply", "", Device::cpu});
  EXPECT_NE(program.find(R"(read("a\"b\\c\012.ply"))"), std::string::npos) << program;
}

}  // namespace
}  // namespace pointfair::viewer
