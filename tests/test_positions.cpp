// SPDX-License-Identifier: Apache-2.0
// Positions in memory: the origin and the points of a file of them, and back without loss.
#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "io_files.h"
#include "pointfair/positions.hpp"

namespace pointfair::test {
namespace {

std::vector<Position> random_positions(std::size_t count, Position centre, double extent) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> uniform(-extent, extent);
  std::vector<Position> result(count);
  for (Position& p : result)
    for (std::size_t axis = 0; axis < 3; ++axis) p[axis] = centre[axis] + uniform(generator);
  return result;
}

// A binary PLY of doubles, written without the library.
std::string ply_of(const std::vector<Position>& positions) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(positions.size()) +
                      "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
  return bytes.append(reinterpret_cast<const char*>(positions.data()), positions.size() * sizeof(Position));
}

bool same(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

}  // namespace

TEST(Positions, MakeTheCloudThatAFileOfThemMakes) {
  for (const Position centre : {Position{}, Position{500000.123, 5.8e6, 120}, Position{1, 2, 3}}) {
    for (const std::size_t count : {1, 5, 4096, 4097, 300000}) {
      const auto values = random_positions(count, centre, 40);
      const Cloud here = make_cloud(values), file = parse(ply_of(values));
      ASSERT_EQ(here.origin, file.origin) << count;
      ASSERT_EQ(choose_origin(values), file.origin);
      for (std::size_t i = 0; i < count; ++i) {
        ASSERT_EQ(here.points[i].x, file.points[i].x);
        ASSERT_EQ(here.points[i].z, file.points[i].z);
      }
    }
  }
  EXPECT_EQ(make_cloud({}).points.size(), 0U);
}

TEST(Positions, FloatsHaveTheOriginOfTheSameDoubles) {
  const auto values = random_positions(10000, {80000, -70000, 5}, 3);
  std::vector<Point> floats;
  std::vector<Position> doubles;
  for (const Position& p : values) {
    floats.push_back({float(p[0]), float(p[1]), float(p[2])});
    doubles.push_back({floats.back().x, floats.back().y, floats.back().z});
  }
  EXPECT_EQ(choose_origin(floats), choose_origin(doubles));
  EXPECT_NE(choose_origin(floats), Position{});
}

TEST(Positions, MoveAsTheFileOfThemDoesAndKeepTheBitsOfTheRest) {
  auto values = random_positions(9000, {500000.123, 5.8e6, 120}, 40);
  values[7][1] = std::numeric_limits<double>::quiet_NaN();
  const auto original = values;
  Cloud file = parse(ply_of(values));
  const Cloud before = make_cloud(values);
  std::vector<Point> after = before.points;
  for (std::size_t i = 0; i < after.size(); i += 3) after[i].x += 0.01F;
  file.points = after;
  std::vector<Position> expected(values.size());
  positions(file, expected);
  move_positions(before, after, values);
  for (std::size_t i = 0; i < values.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ASSERT_TRUE(same(values[i][axis], expected[i][axis])) << i;
      const bool moved = axis == 0 && i % 3 == 0;
      ASSERT_TRUE(moved || same(values[i][axis], original[i][axis])) << i;
    }
    ASSERT_NEAR(values[i][0] - original[i][0], i % 3 == 0 ? 0.01 : 0, 1e-5);
  }
}

TEST(Positions, OfAFileAreItsOwnNumbers) {
  const auto values = random_positions(5000, {500000.123, 5.8e6, 120}, 40);
  const Cloud cloud = parse(ply_of(values));
  EXPECT_EQ(position_type(cloud), ScalarType::float64);
  std::vector<Position> out(values.size());
  positions(cloud, out);
  EXPECT_EQ(out, values);
}

TEST(Positions, OfACloudWithoutAFileAreOffsetsFromItsOrigin) {
  Cloud cloud;
  cloud.points = {{1, 2, 3}};
  EXPECT_EQ(position_type(cloud), ScalarType::float32);
  cloud.origin = {100, 0, 0};
  EXPECT_EQ(position_type(cloud), ScalarType::float64);
  std::vector<Position> out(1);
  positions(cloud, out);
  EXPECT_EQ(out[0], (Position{101, 2, 3}));
}

TEST(Positions, ArraysOfAnotherSizeAreRefused) {
  Cloud cloud;
  cloud.points.resize(2);
  std::vector<Position> out(3);
  EXPECT_EQ(thrown_by([&] { positions(cloud, out); }).kind, ErrorKind::usage);
  EXPECT_EQ(thrown_by([&] { move_positions(cloud, cloud.points, out); }).kind, ErrorKind::usage);
}

}  // namespace pointfair::test
