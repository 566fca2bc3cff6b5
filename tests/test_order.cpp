// SPDX-License-Identifier: Apache-2.0
// The same set of points gives the same result: in any order, and moved exactly; with nothing set, on every device and
// in tiles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "backend_runs.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "shapes.h"
#include "tiles/tiled_backend.hpp"

namespace pointfair {
namespace {

using shapes::Points;

struct Place {
  std::string name;
  std::function<Pipeline()> make;
};

std::vector<Place> places() {
  using MakeWorker = std::function<std::unique_ptr<Backend>()>;
  const auto whole = [](std::string name, MakeWorker make) {
    return Place{std::move(name), [make] { return PipelineAccess::make(make(), {Device::cpu, "test", "requested"}); }};
  };
  const auto tiled = [](std::string name, MakeWorker make) {
    return Place{
        std::move(name), [make] {
          std::vector<std::unique_ptr<Backend>> workers;
          for (int i = 0; i < 2; ++i) workers.push_back(make());
          return PipelineAccess::make(make_tiled_backend(std::move(workers), {5}), {Device::cpu, "test", "requested"});
        }};
  };
  const MakeWorker on_cpu = [] { return make_cpu_backend(2); }, on_card = [] { return make_cuda_backend(0); };
  std::vector<Place> all{whole("cpu", on_cpu), tiled("cpu, tiles", on_cpu)};
  for (const DeviceStatus& card : list_cuda_devices()) {
    if (!card.usable) continue;
    all.push_back(whole("cuda", on_card));
    all.push_back(tiled("cuda, tiles", on_card));
    break;
  }
  return all;
}

Points rounded(Points points, float steps) {
  const auto nearest = [steps](float v) { return std::round(v * steps) / steps; };
  for (Point& p : points) p = {nearest(p.x), nearest(p.y), nearest(p.z)};
  return points;
}

Points with_copies(Points points) {
  for (std::size_t i = 0; i + 1 < points.size(); i += 7) points[i + 1] = points[i];
  return points;
}

Points with_outliers(Points points) {
  shapes::Random random(3);
  for (std::size_t i = 0; i < points.size(); i += 60) points[i].z += float(random.uniform(-0.5, 0.5));
  return points;
}

struct Named {
  std::string name;
  Points points;
};
std::vector<Named> clouds() {
  return {
      {"waves with copies and outliers", with_outliers(with_copies(shapes::with_noise(shapes::waves(12000), 0.006)))},
      {"a cube on a coarse grid, full of ties", rounded(shapes::with_noise(shapes::cube(9000), 0.004), 256)},
      {"an uneven cloud with a stray and invalid points",
       shapes::with_invalid(shapes::with_stray(shapes::uneven(9000, 50), 1e5f), 13)},
      {"every point three times, rounded", shapes::repeated(shapes::with_noise(shapes::waves(4000), 0.006), 3, 1e-6)},
      {"a thick sphere", shapes::with_noise(shapes::sphere(8000), 0.05)}};
}

struct Result {
  Points points, normals;
  std::vector<std::uint8_t> outliers;
};

Result run(const Place& place, const Points& points, const Params& params) {
  Pipeline pipeline = place.make();
  pipeline.load(points);
  Result result{Points(points.size()), Points(points.size()), {}};
  pipeline.run(params, result.points);
  pipeline.normals(result.normals);
  result.outliers.assign(pipeline.outliers().begin(), pipeline.outliers().end());
  return result;
}

void expect_any_order(const Params& params) {
  for (const Named& cloud : clouds())
    for (const Place& place : places()) {
      SCOPED_TRACE(cloud.name + ", " + place.name);
      const Result expected = run(place, cloud.points, params);
      for (const std::uint64_t seed : {1, 2}) {
        const auto order = shapes::shuffle_order(cloud.points.size(), seed);
        const Result found = run(place, shapes::permuted(cloud.points, order), params);
        EXPECT_EQ(difference(found.points, shapes::permuted(expected.points, order)), "");
        EXPECT_EQ(difference(found.normals, shapes::permuted(expected.normals, order)), "");
        for (std::size_t i = 0; i < found.outliers.size(); ++i)
          ASSERT_EQ(found.outliers[i], expected.outliers[order[i]]) << i;
      }
    }
}

TEST(Order, of_the_points_changes_no_bit_with_nothing_set) { expect_any_order({}); }

TEST(Order, of_the_points_changes_no_bit_of_the_marks) { expect_any_order({.outliers = Outliers::mark}); }

TEST(Order, marks_tell_the_same_reason_in_tiles_and_on_every_device) {
  Params params{.outliers = Outliers::mark};
  std::uint8_t last_reason = 0;
  for (const Named& cloud : clouds()) {
    const auto all = places();
    const std::vector<std::uint8_t> expected = run(all[0], cloud.points, params).outliers;
    for (const std::uint8_t reason : expected) last_reason = std::max(last_reason, reason);
    for (const Place& place : all)
      EXPECT_EQ(run(place, cloud.points, params).outliers, expected) << cloud.name << ", " << place.name;
  }
  EXPECT_GT(last_reason, 1);  // there are reasons to be told apart
}

TEST(Order, of_the_points_changes_no_bit_over_lists) {
  expect_any_order({.k = 13, .iterations = 2});
  expect_any_order(paper_preset());
}

TEST(Order, of_the_points_changes_no_bit_where_neighbourhoods_are_thinned) {
  expect_any_order({.radius = 0.2, .min_neighbors = 8});
}

// Coordinates between 1 and 2 are multiples of 2^-23, and so are those moved by a quarter: neither the cloud nor its
// result is rounded.
TEST(Order, a_cloud_moved_exactly_has_the_displacements_of_the_one_before) {
  constexpr float kBy = 0.25f;
  for (const Named& cloud : clouds()) {
    Points points = cloud.points;
    for (Point& p : points) {
      const auto squeezed = [](float v) { return std::abs(v) < 2 ? 1.3f + 0.06f * v : 1.45f; };
      p = {squeezed(p.x), squeezed(p.y), squeezed(p.z)};
    }
    for (const Place& place : places()) {
      SCOPED_TRACE(cloud.name + ", " + place.name);
      const Result here = run(place, points, {}), there = run(place, shapes::shifted(points, {kBy, kBy, kBy}), {});
      EXPECT_EQ(difference(shapes::shifted(here.points, {kBy, kBy, kBy}), there.points), "");
      EXPECT_EQ(difference(here.normals, there.normals), "");
    }
  }
}

}  // namespace
}  // namespace pointfair
