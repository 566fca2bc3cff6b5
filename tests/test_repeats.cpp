// SPDX-License-Identifier: Apache-2.0
// Points that are copies of each other count once: a run leaves as little as it does of one copy, on every way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "backend_runs.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "seam/cloud_sample.hpp"
#include "seam/copies.hpp"
#include "seam/exactness.hpp"
#include "shapes.h"
#include "tiles/tiled_backend.hpp"

namespace pointfair {
namespace {

using shapes::Points;
using shapes::repeated;

constexpr double kNoise = 0.005;

Points noisy_plane() {
  Points points = shapes::plane(3000);
  shapes::Random random(5);
  for (Point& p : points) p.z = float(kNoise * random.normal());
  return points;
}

double rms_height(const Points& points) {
  return reference::rms(points, [](Point p) { return double{p.z}; });
}

TEST(Repeats, leave_as_little_noise_as_one_copy) {
  const double once = rms_height(Ran(noisy_plane()).points);
  ASSERT_LT(once, 0.15 * kNoise);
  for (const int times : {2, 3, 5, 7, 10, 14})
    EXPECT_LT(rms_height(Ran(repeated(noisy_plane(), times, 0)).points), 1.1 * once) << times << " copies";
}

TEST(Repeats, that_differ_by_their_rounding_count_once) {
  const double once = rms_height(Ran(noisy_plane()).points);
  for (const int times : {2, 5, 10})
    EXPECT_LT(rms_height(Ran(repeated(noisy_plane(), times, 1e-6)).points), 1.1 * once) << times << " copies";
}

// Some are at one place, and some one bit off, as of a file in feet and back.
TEST(Repeats, that_are_exact_in_part_count_once) {
  const Points once = noisy_plane();
  Points twice = once;
  for (Point p : once) {
    for (float* value : {&p.x, &p.y, &p.z}) *value = *value / 0.3048f * 0.3048f;
    twice.push_back(p);
  }
  std::size_t off = 0;
  for (std::size_t i = 0; i < once.size(); ++i)
    off += once[i].x != twice[once.size() + i].x || once[i].y != twice[once.size() + i].y;
  ASSERT_GT(off, once.size() / 4);
  ASSERT_LT(off, once.size() * 3 / 4);
  EXPECT_LT(rms_height(Ran(twice).points), 1.1 * rms_height(Ran(once).points));
}

TEST(Repeats, of_a_part_count_once_there) {
  const Points once = noisy_plane();
  const auto is_in_part = [](const Point& p) { return p.x < 0.15f; };
  for (const double rounding : {0.0, 1e-6}) {
    Points of_part;
    std::ranges::copy_if(once, std::back_inserter(of_part), is_in_part);
    Points all = repeated(of_part, 2, rounding);
    std::ranges::copy_if(once, std::back_inserter(all), std::not_fn(is_in_part));
    const Ran ran(all);
    EXPECT_EQ(ran.report.copies, of_part.size());
    EXPECT_LT(rms_height(ran.points), 1.1 * rms_height(Ran(once).points));
  }
}

// A grid that was scanned four times from one place: each scan has noise of its own.
TEST(Repeats, of_a_scan_are_measurements) {
  constexpr int kSide = 60, kScans = 4;
  shapes::Random random(9);
  Points scan, scans;
  for (int i = 0; i < kSide * kSide * kScans; ++i) {
    const int place = i / kScans;
    const auto off = [&](double noise) { return noise / kSide * random.normal(); };
    scans.push_back(shapes::make_point(double(place % kSide) / kSide + off(0.01),
                                       double(place / kSide) / kSide + off(0.01), off(0.1)));
    if (i % kScans == 0) scan.push_back(scans.back());
  }
  const Ran all(scans);
  EXPECT_EQ(all.report.copies, 0u);
  EXPECT_LT(rms_height(all.points), 0.8 * rms_height(Ran(scan).points));
}

TEST(Repeats, stay_together) {
  for (const double rounding : {0.0, 1e-6}) {
    const Points out = Ran(repeated(noisy_plane(), 5, rounding)).points;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const Point& first = out[i / 5 * 5];
      ASSERT_TRUE(out[i].x == first.x && out[i].y == first.y && out[i].z == first.z) << i;
    }
  }
}

// Coordinates as coarse as points lie apart bring several together that were measured apart, and all of them count.
TEST(Repeats, by_coarse_rounding_are_no_copies) {
  const double step = 4 * kNoise;
  Points coarse = shapes::plane(30000);
  shapes::Random random(5);
  for (Point& p : coarse) {
    p.z = float(kNoise * random.normal());
    for (float* value : {&p.x, &p.y, &p.z}) *value = float(step * std::round(*value / step));
  }
  EXPECT_LT(rms_height(Ran(coarse).points), 0.1 * rms_height(coarse)) << "one of each leaves a quarter";
}

// Needs the spacing, and no noise.
Params all_given() {
  return {.noise = Length(0.005),
          .k = 8,
          .constraint = true,
          .delta = Length(0.01),
          .normal_sigma = Length(0.05),
          .closeness_sigma = Length(0.05),
          .similarity_sigma = Length(0.02),
          .outliers = Outliers::off};
}

TEST(Repeats, leave_no_trace_in_later_runs_and_earlier_runs_none_in_them) {
  const Points points = repeated(noisy_plane(), 3, 0);
  Params lists = all_given();
  const Points automatic = Ran(points).points, listed = Ran(points, lists).points;
  Pipeline pipeline = loaded(points);
  Points out(points.size());
  for (int turn = 0; turn < 2; ++turn) {
    pipeline.run(lists, out);
    EXPECT_EQ(difference(out, listed), "") << turn;
    pipeline.run({}, out);
    EXPECT_EQ(difference(out, automatic), "") << turn;
  }
}

TEST(Repeats, have_the_normals_of_the_last_run_whatever_was_measured_since) {
  const Points points = repeated(noisy_plane(), 3, 0);
  Ran ran(points, all_given());
  const Points normals = ran.normals();
  EXPECT_GT(ran.pipeline.estimates().noise, 0.5 * kNoise);
  EXPECT_EQ(difference(ran.normals(), normals), "");
}

TEST(Repeats, are_marked_and_counted_each) {
  Points points = noisy_plane();
  for (std::size_t i = 0; i < 5; ++i) points[100 * i + 7].z = 0.4f;
  const int times = 4;
  const Ran once(points, {.outliers = Outliers::mark}), all(repeated(points, times, 0), {.outliers = Outliers::mark});
  ASSERT_GE(once.report.unmoved.outliers, 5u);
  std::size_t marked = 0;
  for (std::size_t i = 0; i < all.outliers.size(); ++i) {
    marked += all.outliers[i] != 0;
    ASSERT_EQ(all.outliers[i], all.outliers[i / times * times]);
  }
  EXPECT_EQ(all.report.unmoved.outliers, marked);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NE(all.outliers[std::size_t(times) * (100 * i + 7)], 0);
}

TEST(Repeats, in_tiles_have_the_bits_of_the_whole) {
  for (const double rounding : {0.0, 1e-6}) {
    Points points = repeated(noisy_plane(), 3, rounding);
    for (std::size_t i = 0; i < 5; ++i) points[300 * i + 7].z = 0.4f;
    const Ran whole(points, {.outliers = Outliers::mark});
    std::vector<std::unique_ptr<Backend>> workers;
    workers.push_back(make_cpu_backend(2));
    Pipeline tiled =
        PipelineAccess::make(make_tiled_backend(std::move(workers), {.tiles = 5}), {Device::cpu, "tiles", "test"});
    Points out(points.size()), normals(points.size());
    tiled.load(points);
    tiled.run({.outliers = Outliers::mark}, out);
    EXPECT_EQ(difference(out, whole.points), "");
    EXPECT_TRUE(std::ranges::equal(tiled.outliers(), whole.outliers));
    EXPECT_EQ(tiled.report().unmoved, whole.report.unmoved);
    EXPECT_EQ(tiled.report().tiles, 5u);
  }
}

// By its definition: the first of a cell of half the distance, and of firsts the first around them.
std::vector<std::uint32_t> firsts_of(const Points& points, double within, Point corner) {
  const auto order = [&](std::size_t i) {
    return std::tuple(point::position_hash(to_vec3(points[i]), to_vec3(corner)), points[i].x, points[i].y, points[i].z,
                      i);
  };
  const auto distance = [&](std::size_t i, std::size_t j) {
    return reference::length(reference::to_vec(points[i]) - reference::to_vec(points[j]));
  };
  const auto cell = [&](std::size_t i) {
    const auto off = reference::to_vec(points[i]) - reference::to_vec(corner);
    return std::tuple(std::floor(2 * off.x / within), std::floor(2 * off.y / within), std::floor(2 * off.z / within));
  };
  const auto first_where = [&](std::size_t i, const auto& counts) {
    std::size_t best = i;
    for (std::size_t j = 0; j < points.size(); ++j)
      if (counts(j) && order(j) < order(best)) best = j;
    return std::uint32_t(best);
  };
  std::vector<std::uint32_t> of_cell(points.size()), before(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    of_cell[i] = first_where(i, [&](std::size_t j) { return within > 0 ? cell(j) == cell(i) : distance(i, j) == 0; });
  for (std::size_t i = 0; i < points.size(); ++i)
    before[i] = of_cell[i] != i
                    ? of_cell[i]
                    : first_where(i, [&](std::size_t j) { return of_cell[j] == j && distance(i, j) <= within; });
  for (std::size_t i = 0; i < points.size(); ++i)
    while (before[before[i]] != before[i]) before[i] = before[before[i]];
  return before;
}

// In a cloud in zones, the first of some may have moved away from them, around another origin.
TEST(Repeats, known_copies_without_their_first_are_one_point_whichever_of_them_are_known) {
  const std::vector<Point> points = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {0, 0, 0}, {2, 0, 0}, {1, 0, 0}};
  const auto pairs = [&](std::vector<std::uint32_t> known) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> found;
    for (const Copy& copy : copies_at_one_place(points, known)) found.push_back({copy.point, copy.first});
    return found;
  };
  using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;
  EXPECT_EQ(pairs({1, 2, 3, 5}), (Pairs{{2, 1}, {3, 0}, {5, 1}}));
  EXPECT_EQ(pairs({2, 3, 5}), (Pairs{{2, 1}, {3, 0}, {5, 1}}));
  EXPECT_EQ(pairs({1, 3, 4, 5}), (Pairs{{1, 2}, {3, 0}, {5, 2}}));
  EXPECT_EQ(pairs({4}), Pairs{});
}

TEST(Repeats, follow_the_first_around_them_by_its_hash) {
  for (const double within : {0.0, 1e-3, 0.03}) {
    const Points points = repeated(shapes::plane(300), 3, within / 3);
    const std::vector<std::uint32_t> expected = firsts_of(points, within, {-2, -2, -2});
    const std::vector<Copy> copies = copies_among(points, {within, {-2, -2, -2}}, kEverywhere);
    std::size_t followers = 0;
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(first_of(copies, i), expected[i]) << i << " within " << within;
      followers += expected[i] != i;
    }
    EXPECT_EQ(copies.size(), followers);
  }
}

// What is sure in a part of a cloud is so in the whole.
TEST(Repeats, that_are_sure_in_a_part_follow_the_same_point_in_the_whole) {
  const CopyRule rule{0.02, {-2, -2, -2}};
  const point::Region region{{0.3f, 0.35f, -1}, {0.7f, 0.8f, 1}}, known = without_border(region, rule);
  for (const int count : {2000, 60000}) {
    const Points points = repeated(shapes::plane(count), 2, 0.006);
    Points part;
    std::vector<std::uint32_t> numbers;
    for (std::uint32_t i = 0; i < points.size(); ++i)
      if (point::is_inside(region, to_vec3(points[i]))) part.push_back(points[i]), numbers.push_back(i);
    const std::vector<Copy> whole = copies_among(points, rule, kEverywhere), of_part = copies_among(part, rule, region);
    std::size_t sure = 0, different = 0;
    for (std::uint32_t i = 0; i < part.size(); ++i) {
      const bool same = numbers[first_of(of_part, i)] == first_of(whole, numbers[i]),
                 is_known = is_sure(of_part, i) && point::is_inside(known, to_vec3(part[i]));
      EXPECT_TRUE(same || !is_known) << i << " of " << count;
      sure += is_known;
      different += !same;
    }
    EXPECT_GT(sure, part.size() / 10);
    EXPECT_GT(different, 0u);
  }
}

TEST(Repeats, of_unwelded_faces_leave_as_little_noise_as_welded_ones) {
  Points vertices = shapes::sphere(4000);
  shapes::Random random(7);
  for (Point& p : vertices) {
    const double radius = 1 + 0.01 * random.normal();
    p = {float(radius * p.x), float(radius * p.y), float(radius * p.z)};
  }
  const auto off_the_sphere = [](const Points& points) {
    return reference::rms(points, [](Point p) { return reference::length(reference::to_vec(p)) - 1; });
  };
  EXPECT_LT(off_the_sphere(Ran(repeated(vertices, 6, 0)).points), 1.05 * off_the_sphere(Ran(vertices).points));
}

// The nodes of a mesh lie on multiples of its step, and none of them was rounded.
TEST(Repeats, are_none_in_a_cube_of_a_regular_mesh_which_stays_as_it_is) {
  constexpr int kCells = 15;
  Points cube;
  for (int x = 0; x <= kCells; ++x)
    for (int y = 0; y <= kCells; ++y)
      for (int z = 0; z <= kCells; ++z)
        if (x % kCells == 0 || y % kCells == 0 || z % kCells == 0) cube.push_back({float(x), float(y), float(z)});
  const Points out = Ran(cube).points;
  for (std::size_t i = 0; i < cube.size(); ++i)
    ASSERT_LT(std::hypot(out[i].x - cube[i].x, out[i].y - cube[i].y, out[i].z - cube[i].z), 0.05) << i;
}

// Rows along x, each with one height of its own and with noise of its points.
Points in_rows(const std::function<double(int)>& height, double noise) {
  constexpr int kRows = 60, kOfRow = 500;
  Points points;
  shapes::Random random(8);
  for (int row = 0; row < kRows; ++row)
    for (int i = 0; i < kOfRow; ++i)
      points.push_back(shapes::make_point((i + random.uniform()) / kOfRow, double(row) / kRows,
                                          height(row) + noise * random.normal()));
  return points;
}

// Of the points whose neighbourhoods have rows on both sides.
double rms_off(const Points& points, const std::function<double(int)>& height) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int row = int(i / 500);
    if (row < 5 || row >= 55) continue;
    const double off = points[i].z - height(row);
    sum += off * off;
    ++count;
  }
  return std::sqrt(sum / double(count));
}

TEST(Repeats, include_points_of_a_row_that_share_an_error) {
  shapes::Random random(9);
  std::vector<double> error(60);
  for (double& its : error) its = 0.003 * random.normal();
  const Points noisy = in_rows([&](int row) { return error[std::size_t(row)]; }, 0.0005);
  const auto flat = [](int) { return 0.0; };
  EXPECT_LT(rms_off(Ran(noisy).points, flat), 0.7 * rms_off(noisy, flat));
}

TEST(Repeats, are_no_waves_across_rows) {
  for (const double period : {4, 5, 7}) {
    const auto waves = [&](int row) { return 0.008 * std::sin(row * 2 * 3.14159265 / period + 0.3); };
    const Points noisy = in_rows(waves, 0.0005);
    EXPECT_LT(rms_off(Ran(noisy).points, waves), 1.1 * rms_off(noisy, waves)) << period << " rows";
  }
}

}  // namespace
}  // namespace pointfair
