// SPDX-License-Identifier: Apache-2.0
// Positions in memory: the origin and the points of a file of them, and back without loss.
#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "io_files.h"
#include "pointfair/file_info.hpp"
#include "pointfair/normals.hpp"
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

// Whether the bulk, from the 5 % to the 95 % quantile, lies farther from 0 on an axis than 16 times its widest side.
bool lies_far_from_zero(const std::vector<Point>& points) {
  double extent = 0, size = 0;
  for (const auto axis : {&Point::x, &Point::y, &Point::z}) {
    std::vector<double> values;
    for (const Point& p : points)
      if (std::isfinite(p.x + p.y + p.z)) values.push_back(p.*axis);
    if (values.empty()) return false;
    std::sort(values.begin(), values.end());
    const double low = values[values.size() / 20], high = values[values.size() - 1 - values.size() / 20];
    extent = std::max(extent, high - low);
    size = std::max({size, std::abs(low), std::abs(high)});
  }
  return extent > 0 && size > 4 * extent;
}

// About where an origin is needed; every third cloud with strays, every fourth in lumps, every fifth with a NaN.
std::vector<Point> cloud_of_kind(int kind) {
  std::mt19937 generator{static_cast<unsigned>(kind)};
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double offset = (kind % 10) * 3.1, power = kind % 3 == 0 ? 9 : 1, lumps = kind % 4 == 0 ? 3 : 1e6;
  const auto value = [&] {
    const double u = uniform(generator);
    return std::round(std::copysign(std::pow(std::abs(u), power), u) * lumps) / lumps;
  };
  std::vector<Point> points;
  for (int i = 0; i < 2 + kind * 7; ++i) {
    const double x = offset + value(), y = value(), z = offset / 2 + value();
    points.push_back({float(x), float(y), float(z)});
  }
  if (kind % 5 == 0) points[0].z = std::numeric_limits<float>::quiet_NaN();
  return points;
}

}  // namespace

TEST(Positions, HaveAnOriginIfTheirBulkLiesFarFromZero) {
  std::vector<Point> all;
  std::vector<std::uint64_t> offsets{0};
  int with = 0;
  for (int kind = 0; kind < 400; ++kind) {
    const std::vector<Point> points = cloud_of_kind(kind);
    const bool has_origin = choose_origin(points) != Position{};
    EXPECT_EQ(has_origin, lies_far_from_zero(points)) << kind;
    with += has_origin;
    all.insert(all.end(), points.begin(), points.end());
    offsets.push_back(all.size());
  }
  EXPECT_GT(with, 20);
  EXPECT_LT(with, 380);
  const std::vector<Position> origins = choose_origins(all, offsets);
  ASSERT_EQ(origins.size(), 400u);
  for (int kind = 0; kind < 400; ++kind) EXPECT_EQ(origins[std::size_t(kind)], choose_origin(cloud_of_kind(kind)));
}

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

// At UTM coordinates, floats around 0 step by 31 mm.
TEST(Positions, OfAWideSurveyLieAroundItsMiddle) {
  for (const double extent : {1e3, 33e3, 60e3, 110e3}) {
    const Position origin = choose_origin(random_positions(10000, {500000, 5400000, 100}, extent / 2));
    EXPECT_NEAR(origin[0], 500000, extent / 4);
    EXPECT_NEAR(origin[1], 5400000, extent / 4);
  }
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

TEST(Positions, ThatStayKeepTheSignsOfTheirZeros) {
  std::vector<Position> values = {{-0.0, 1, 0.0}, {5, -0.0, -0.0}};
  const Cloud before = make_cloud(values);
  move_positions(before, std::vector<Point>{{0.0F, 2, -0.0F}, {5, 0.0F, 1}}, values);
  EXPECT_TRUE(std::signbit(values[0][0]) && !std::signbit(values[0][2]) && std::signbit(values[1][1]));
  EXPECT_EQ(values[0][1], 2);
  EXPECT_EQ(values[1][2], 1);
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
  Cloud cloud{.points = {{1, 2, 3}}};
  EXPECT_EQ(position_type(cloud), ScalarType::float32);
  cloud.origin = {100, 0, 0};
  EXPECT_EQ(position_type(cloud), ScalarType::float64);
  std::vector<Position> out(1);
  positions(cloud, out);
  EXPECT_EQ(out[0], (Position{101, 2, 3}));
}

// Whatever the cloud was: of a file of doubles or floats, or of none, near zero or far from it.
TEST(Positions, ThatAreSetKeepTheirDigits) {
  const auto near = random_positions(300, {}, 40), far = random_positions(300, {500000.123, 5.8e6, 120}, 40);
  Cloud bare;
  bare.points.resize(near.size());
  Cloud text = parse(image(parse(ply_of(near)), Format::xyz), "cloud.xyz");
  for (const Cloud& start : {parse(ply_of(near)), parse(ply_of(far)), text, bare}) {
    Cloud cloud = start;
    for (const auto& wanted : {far, near, far}) {
      set_positions(cloud, wanted);
      std::vector<Position> out(wanted.size());
      positions(cloud, out);
      EXPECT_EQ(out, wanted);
      EXPECT_EQ(cloud.origin, choose_origin(wanted));
      positions(parse(image(cloud, Format::ply)), out);
      EXPECT_EQ(out, wanted);
    }
  }
}

// Also where some points were left out, before or after others were set, in the file's own format and in another.
TEST(Positions, ThatAreSetWherePointsAreLeftOutKeepTheirDigits) {
  const auto near = random_positions(300, {}, 40), far = random_positions(300, {500000.123, 5.8e6, 120}, 40);
  std::vector<std::uint8_t> removed(300);
  removed[3] = removed[250] = 1;
  const auto left_of = [](std::vector<Position> all) {
    all.erase(all.begin() + 250);
    all.erase(all.begin() + 3);
    return all;
  };
  const Cloud text = parse(image(parse(ply_of(near)), Format::xyz), "cloud.xyz");
  const Cloud off = parse(image(parse(ply_of(near)), Format::off), "cloud.off");
  for (const Cloud& start : {parse(ply_of(near)), parse(ply_of(far)), text, off})
    for (const bool is_set_before : {false, true}) {
      Cloud cloud = start;
      if (is_set_before) set_positions(cloud, far);
      cloud = without_points(cloud, removed);
      for (const auto& wanted : {left_of(far), left_of(near)}) {
        set_positions(cloud, wanted);
        std::vector<Position> out(wanted.size());
        positions(cloud, out);
        EXPECT_EQ(out, wanted);
        const Format own = *file_info(start).format;
        const std::string name = own == Format::ply ? "c.ply" : own == Format::off ? "c.off" : "c.xyz";
        const Cloud written = parse(image(cloud, own), name);
        ASSERT_EQ(written.points.size(), wanted.size()) << name << is_set_before;
        positions(written, out);
        EXPECT_EQ(out, wanted) << name << is_set_before;
      }
    }
}

TEST(Positions, ThatAreSetInPartLeaveTheBytesOfTheOthers) {
  auto values = random_positions(300, {500000.123, 5.8e6, 120}, 40);
  const std::string before = ply_of(values);
  Cloud cloud = parse(before);
  values[7] = {1.0 / 3, 2, std::numeric_limits<double>::quiet_NaN()};
  set_positions(cloud, values);
  EXPECT_EQ(image(cloud, Format::ply), ply_of(values));
  cloud.points[9].x += 1;  // from there the points move as any
  const double is = values[9][0];
  std::vector<Position> out(values.size());
  positions(cloud, out);
  EXPECT_NEAR(out[9][0], is + 1, 1e-5);
  out[9] = values[9];
  set_positions(cloud, random_positions(300, {}, 40));
  set_positions(cloud, out);
  EXPECT_EQ(image(cloud, Format::ply), ply_of(values));
}

TEST(Positions, ArraysOfAnotherSizeAreRefused) {
  Cloud cloud;
  cloud.points.resize(2);
  std::vector<Position> out(3);
  EXPECT_EQ(thrown_by([&] { positions(cloud, out); }).kind, ErrorKind::usage);
  EXPECT_EQ(thrown_by([&] { set_positions(cloud, out); }).kind, ErrorKind::usage);
  EXPECT_EQ(thrown_by([&] { move_positions(cloud, cloud.points, out); }).kind, ErrorKind::usage);
}

// Points that were left out by hand are not told from those that stay.
TEST(Positions, OfACloudWithoutAllPointsOfItsFileAreRefused) {
  const Cloud file = parse(ply_of(random_positions(100, {}, 1)));
  for (const std::size_t count : {10u, 99u, 101u}) {
    Cloud cloud = file;
    cloud.points.resize(count);
    std::vector<Position> out(count);
    const std::vector<Point> normals(count, Point{0, 0, 1});
    Pipeline pipeline(Device::cpu);
    for (const std::function<void()>& call : std::vector<std::function<void()>>{
             [&] { positions(cloud, out); },
             [&] { set_positions(cloud, out); },
             [&] { without_points(cloud, std::vector<std::uint8_t>(count, 0)); },
             [&] { attribute(cloud, "number"); },
             [&] { set_normals(cloud, normals); },
             [&] { pipeline.load(cloud); },
             [&] { write_bytes(cloud, Format::ply); },
         })
      expect_error(ErrorKind::usage, "its file 100; keep them all", call);
    EXPECT_EQ(cloud.points.size(), count);
  }
}

}  // namespace pointfair::test
