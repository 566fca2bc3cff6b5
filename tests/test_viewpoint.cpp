// SPDX-License-Identifier: Apache-2.0
// Where the sensor stood: mixed pixels between two surfaces, moves along the rays, and the sign of normals.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "backend_runs.h"
#include "board_scan.h"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using reference::Vec, reference::dot, reference::length, reference::to_vec;
using shapes::Points;

TEST(Viewpoint, shows_mixed_pixels) {
  const Scan cloud = scan();
  const Ran seen = run(cloud.points, {&kSensor, 1}, marking()), blind = run(cloud.points, nowhere(), marking());
  const Shares with = shares(cloud, seen.outliers), without = shares(cloud, blind.outliers);
  EXPECT_GT(with.found, 0.8);
  EXPECT_LT(with.wrong, 0.001);
  EXPECT_GT(with.found, without.found);
  EXPECT_EQ(blind.report.unmoved.outliers_by_reason.mixed_pixels, 0u);
  const OutlierCounts& reasons = seen.report.unmoved.outliers_by_reason;
  EXPECT_GT(reasons.mixed_pixels, 100u);
  EXPECT_EQ(reasons.total(), seen.report.unmoved.outliers);
  EXPECT_EQ(seen.report.unmoved.outliers,
            std::uint64_t(seen.outliers.size() - std::count(seen.outliers.begin(), seen.outliers.end(), 0)));
  EXPECT_EQ(reasons.mixed_pixels, std::uint64_t(std::count(seen.outliers.begin(), seen.outliers.end(), 3)));
}

// Of a grid of rays about the sensor at the origin, `depth` along the y axis of each, with noise along it.
template <class Depth>
Points grid_of_rays(int rows, double row_step, int columns, double column_step, const Depth& depth) {
  Points points;
  shapes::Random random(7);
  for (int row = -rows; row <= rows; ++row)
    for (int column = -columns; column <= columns; ++column) {
      const double a = column * column_step, e = row * row_step;
      const double range = depth(row, column) / (std::cos(e) * std::cos(a)) + kNoise * random.normal();
      points.push_back(shapes::make_point(range * std::cos(e) * std::sin(a), range * std::cos(e) * std::cos(a),
                                          range * std::sin(e)));
    }
  return points;
}

// Behind one border of a board at 3 m, `together` of every `period` rays end at one depth between `low` and `high`.
Shares found_behind_board(int together, int period, double low, double high, double wall) {
  constexpr int kHalf = 90, kBoard = 40;
  const auto is_mixed = [&](int row, int column) {
    return column == kBoard + 1 && std::abs(row) <= kBoard && (row + kBoard) % period < together;
  };
  shapes::Random random(11);
  std::vector<double> depth_of_group(2 * kBoard + 1);
  for (double& depth : depth_of_group) depth = random.uniform(low, high);
  Scan scan;
  scan.points = grid_of_rays(kHalf, kStep, kHalf, kStep, [&](int row, int column) {
    scan.is_mixed.push_back(is_mixed(row, column));
    if (is_mixed(row, column)) return depth_of_group[std::size_t((row + kBoard) / period)];
    return std::abs(row) <= kBoard && std::abs(column) <= kBoard ? 3.0 : wall;
  });
  const Position origin{};
  return shares(scan, run(scan.points, {&origin, 1}, marking()).outliers);
}

TEST(Viewpoint, shows_mixed_pixels_that_have_others_beside_them) {
  const Shares groups_of_five = found_behind_board(5, 5, 3.2, 3.8, 4.0);
  EXPECT_GT(groups_of_five.found, 0.8);
  EXPECT_LT(groups_of_five.wrong, 0.001);
}

// Each has two others within two steps of the rays, and twelve points with those of the board; the middle of three has
// two beside it.
TEST(Viewpoint, shows_mixed_pixels_in_groups_close_to_a_surface) {
  constexpr double kStepAtBoard = 3 * kStep;
  const Shares groups_of_three = found_behind_board(3, 5, 3 + 3 * kStepAtBoard, 3 + 6 * kStepAtBoard, 3.3);
  EXPECT_GT(groups_of_three.found, 0.9);
  EXPECT_LT(groups_of_three.wrong, 0.001);
}

// The rings of a spinning lidar lie four times as far apart as the points along one. Of upright bars two points wide,
// only the ends lack neighbours.
TEST(Viewpoint, takes_no_bars_across_coarse_rings_for_mixed_pixels) {
  constexpr int kRings = 30, kHalf = 199, kEnd = 4;
  const auto is_bar = [](int column) { return (column + kHalf) % 50 < 2; };
  const Points points = grid_of_rays(kRings, 4 * kStep, kHalf, kStep,
                                     [&](int, int column) { return is_bar(column) ? 3.0 : 6.0 + 0.01 * column; });
  const Position origin{};
  Params params = marking();
  params.noise = kNoise;
  const std::vector<std::uint8_t> marks = run(points, {&origin, 1}, params).outliers;
  int bars = 0, marked = 0;
  for (int ring = -kRings, i = 0; ring <= kRings; ++ring)
    for (int column = -kHalf; column <= kHalf; ++column, ++i) {
      if (!is_bar(column) || std::abs(ring) > kRings - kEnd) continue;
      ++bars;
      marked += marks[std::size_t(i)] != 0;
    }
  EXPECT_LT(marked, 0.05 * bars);
}

// A floor far away turns more than 80 degrees from the rays: its rows lie far apart, its columns do not.
TEST(Viewpoint, takes_no_steep_surface_for_mixed_pixels) {
  Points floor;
  shapes::Random random(5);
  for (int row = 45; row <= 400; ++row)
    for (int column = -100; column <= 100; ++column) {
      const double a = column * kStep, e = row * kStep, range = 1.5 / std::sin(e) + kNoise * random.normal();
      floor.push_back(shapes::make_point(range * std::cos(e) * std::sin(a), range * std::cos(e) * std::cos(a),
                                         -range * std::sin(e)));
    }
  const Position origin{};
  EXPECT_LT(run(floor, {&origin, 1}).report.unmoved.outliers_by_reason.mixed_pixels, floor.size() / 1000);
}

// An even cloud whose file names a place in its middle: no sensor saw it from there.
TEST(Viewpoint, that_is_wrong_shows_nothing) {
  const Points plane = shapes::with_noise(shapes::plane(20000), 0.002);
  const Position beside{0.5, 0.5, 0.05};
  const OutlierCounts reasons = run(plane, {&beside, 1}).report.unmoved.outliers_by_reason;
  EXPECT_EQ(reasons.mixed_pixels, 0u);
  EXPECT_EQ(reasons, run(plane, nowhere()).report.unmoved.outliers_by_reason);
}

TEST(Viewpoint, may_be_told_for_each_point) {
  const Scan cloud = scan();
  std::vector<Position> each(cloud.points.size(), kSensor);
  for (const Along along : {Along::normal, Along::ray}) {
    Params params = marking();
    params.along = along;
    const Ran one = run(cloud.points, {&kSensor, 1}, params), many = run(cloud.points, each, params);
    EXPECT_EQ(difference(one.points, many.points), "");
    EXPECT_EQ(one.outliers, many.outliers);
  }
  // unknown places are as if there were none
  const Ran unknown = run(cloud.points, std::vector<Position>(each.size(), Position{kNan, kNan, kNan}), marking());
  EXPECT_EQ(difference(unknown.points, run(cloud.points, nowhere(), marking()).points), "");
  const std::vector<Position> too_few(each.begin(), each.begin() + 7);
  EXPECT_THROW(run(cloud.points, too_few), Error);
}

TEST(Viewpoint, is_forgotten_by_the_next_load) {
  const Scan cloud = scan();
  Pipeline pipeline = loaded(cloud.points);
  pipeline.set_viewpoint({&kSensor, 1});
  Points out(cloud.points.size());
  pipeline.run({}, out);
  EXPECT_GT(pipeline.report().unmoved.outliers_by_reason.mixed_pixels, 0u);
  pipeline.set_viewpoint({});
  pipeline.run({}, out);
  EXPECT_EQ(pipeline.report().unmoved.outliers_by_reason.mixed_pixels, 0u);
  EXPECT_FALSE(pipeline.report().found_sensor.has_value());
  pipeline.load(cloud.points);
  pipeline.run({}, out);
  EXPECT_TRUE(pipeline.report().found_sensor.has_value());
}

double angle(const Point& p, const Point& q) {
  const Vec a = to_vec(p) - Vec{kSensor[0], kSensor[1], kSensor[2]},
            b = to_vec(q) - Vec{kSensor[0], kSensor[1], kSensor[2]};
  return length(cross(a, b)) / (length(a) * length(b));
}

// Mean distance to the surface of what is no mixed pixel.
double mean_error(const Scan& cloud, const Points& points) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (cloud.is_mixed[i] != 0) continue;
    const double depth = cloud.range[i] * cloud.rays[i][1];
    sum += std::abs(points[i].y - kSensor[1] - depth);
    ++count;
  }
  return sum / count;
}

TEST(AlongRay, keeps_each_pixel_and_removes_as_much_noise) {
  const Scan cloud = scan();
  for (const Method method : {Method::bilateral, Method::mls, Method::wiener}) {
    Params params{.method = method};
    const Ran normal = run(cloud.points, {&kSensor, 1}, params);
    params.along = Along::ray;
    const Ran ray = run(cloud.points, {&kSensor, 1}, params);
    double most = 0, most_normal = 0;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      most = std::max(most, angle(cloud.points[i], ray.points[i]));
      most_normal = std::max(most_normal, angle(cloud.points[i], normal.points[i]));
    }
    EXPECT_LT(most, 4e-7) << int(method);  // of rounding in floats
    EXPECT_GT(most_normal, 1e-5) << int(method);
    EXPECT_LT(mean_error(cloud, ray.points), 1.02 * mean_error(cloud, normal.points)) << int(method);
    EXPECT_LT(mean_error(cloud, ray.points), 0.6 * mean_error(cloud, cloud.points)) << int(method);
  }
}

// One step, in double from the step along the normal: d / (n.r) along the ray, fading where |n.r| is below 0.25.
TEST(AlongRay, ends_on_the_same_plane) {
  const Points points = shapes::with_noise(shapes::sphere(8000), 0.004);
  const Position sensor{0.3, 0.2, 3};
  Params params{.k = 20,
                .normal_sigma = 0.1,
                .closeness_sigma = 0.05,
                .similarity_sigma = 0.05,
                .outliers = Outliers::off,
                .iterations = 1};
  Pipeline pipeline = loaded(points);
  pipeline.set_viewpoint({&sensor, 1});
  Points normal(points.size()), ray(points.size()), normals(points.size());
  pipeline.run(params, normal);
  pipeline.normals(normals);
  params.along = Along::ray;
  pipeline.run(params, ray);
  int grazing = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec p = to_vec(points[i]), n = to_vec(normals[i]);
    const Vec to = Vec{sensor[0], sensor[1], sensor[2]} - p, r = (1 / length(to)) * to;
    const double d = dot(to_vec(normal[i]) - p, n), cosine = dot(n, r);
    EXPECT_GE(cosine, 0) << "normals look to the sensor";
    grazing += std::abs(cosine) < 0.25;
    const double way = std::abs(cosine) < 0.25 ? d * cosine / 0.0625 : d / cosine;
    ASSERT_LT(length(to_vec(ray[i]) - (p + way * r)), 4e-6) << i;
  }
  EXPECT_GT(grazing, 100);
}

TEST(AlongRay, needs_a_sensor_and_a_method_that_moves_along_the_normal) {
  const Points points = shapes::with_noise(shapes::plane(2000), 0.002);
  Params params{.along = Along::ray};
  EXPECT_THROW(run(points, {}, params), Error);
  params.method = Method::laplacian;
  const Position above{0.5, 0.5, 3};
  EXPECT_THROW(run(points, {&above, 1}, params), Error);
}

TEST(Viewpoint, is_read_as_users_give_it) {
  Cloud cloud = shapes::as_cloud(shapes::plane(3));
  for (const char* name : {"vx", "vy", "vz"}) {
    Attribute& added = cloud.added.emplace_back();
    added.name = name;
    const std::array<float, 3> values{float(name[1]), 2, 3};
    const auto bytes = std::as_bytes(std::span(values));
    added.data.assign(bytes.begin(), bytes.end());
  }
  EXPECT_EQ(parse_viewpoints("1,-2.5,3e1", cloud), std::vector{(Position{1, -2.5, 30})});
  EXPECT_EQ(parse_viewpoints("vx,vy,vz", cloud)[0], (Position{double('x'), double('y'), double('z')}));
  EXPECT_EQ(parse_viewpoints("vx,vy,vz", cloud)[2], (Position{3, 3, 3}));
  EXPECT_TRUE(parse_viewpoints("none", cloud).empty());
  EXPECT_TRUE(parse_viewpoints("", cloud).empty()) << "no file, so nothing is known";
  for (const char* wrong : {"1,2", "1,2,3,4", "1,2,", "1,vy,3", "vx,vy,vw", "1m,2m,3m", "nan,1,2", "nan,nan,nan"})
    EXPECT_THROW(parse_viewpoints(wrong, cloud), Error) << wrong;
}

TEST(Viewpoint, turns_normals_to_the_sensor) {
  Cloud cloud = shapes::as_cloud({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
  const std::vector<Point> normals(3, Point{0, 0, 1});
  set_normals(cloud, normals, std::vector<Position>{{0, 0, -5}, {0, 0, 5}, {kNan, kNan, kNan}});
  const Attribute found = attribute(cloud, "normal");
  std::array<float, 9> values{};
  std::memcpy(values.data(), found.data.data(), sizeof values);
  EXPECT_EQ(values[2], -1);
  EXPECT_EQ(values[5], 1);
  EXPECT_EQ(values[8], 1) << "of an unknown place: outward, which is up";
}

// Every reason in its own place, over iterations.
TEST(Outliers, are_counted_by_reason) {
  for (const int iterations : {1, 2, 3}) {
    Points points = shapes::with_noise(shapes::plane(20000), 0.003);
    for (std::size_t i = 500; i < points.size(); i += 1000)
      points[i].z = i % 2000 == 500 ? 0.06f : -0.06f;  // 20 sigmas
    for (int i = 0; i < 5; ++i) points[std::size_t(i)] = {float(20 * i + 30), float(i), 50};
    Params params = marking();
    params.iterations = iterations;
    const Ran outcome = run(points, {}, params);
    const OutlierCounts& reasons = outcome.report.unmoved.outliers_by_reason;
    EXPECT_EQ(reasons.total(), outcome.report.unmoved.outliers);
    EXPECT_GE(reasons.isolated, 5u) << iterations;
    EXPECT_GE(reasons.off_surface + reasons.isolated, 22u) << iterations;
    EXPECT_EQ(reasons.mixed_pixels, 0u);
  }
}

}  // namespace
}  // namespace pointfair
