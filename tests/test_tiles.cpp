// SPDX-License-Identifier: Apache-2.0
// Clouds that are computed in tiles give the bits of the whole.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "backend_runs.h"
#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "seam/sampling.hpp"
#include "shapes.h"
#include "tiles/tiled_backend.hpp"

namespace pointfair {
namespace {

using shapes::Points;

int usable_cards() {
  int count = 0;
  for (const DeviceStatus& device : list_cuda_devices()) count += device.usable;
  return count;
}

// Every device of this machine; `workers` of them at once cut a cloud, fed by so many threads: one for each card.
struct Place {
  Device::Kind kind;
  int workers;
  std::size_t feeders = 1;
  std::unique_ptr<Backend> make(int card = 0) const {
    return kind == Device::cpu ? make_cpu_backend(0) : make_cuda_backend(card);
  }
  std::unique_ptr<Backend> make_tiled(Tiling tiling) const {
    std::vector<std::unique_ptr<Backend>> backends;
    for (int i = 0; i < workers; ++i)
      backends.push_back(make(kind == Device::cpu ? 0 : i * int(feeders) / workers % usable_cards()));
    tiling.feeders = feeders;
    return make_tiled_backend(std::move(backends), tiling);
  }
};
// A machine with one card has it twice.
std::vector<Place> places() {
  std::vector<Place> all{{Device::cpu, 1}, {Device::cpu, 4, 2}};
  if (usable_cards() > 0) {
    all.push_back({Device::cuda, 2});
    all.push_back({Device::cuda, 4, 2});
  }
  return all;
}

StageSettings usual() { return {.normals = {{0.02f}}, .fairing = {{0.02f, 0.01f}}}; }

void expect_the_same_in_tiles(const Points& points, StageSettings settings, const char* what,
                              const std::vector<Tiling>& tilings = {{2}, {3, ~0ull, 0.2}, {7, ~0ull, 0.05}}) {
  if (settings.neighbors.k == 0) settings.frame = frame_over({-1.5f, -1.5f, -1.5f}, 3);
  for (const Place& place : places()) {
    const StageResults whole = run(*place.make(), points, settings);
    for (const Tiling& tiling : tilings) {
      SCOPED_TRACE(std::string(what) + ", " + (place.kind == Device::cpu ? "cpu" : "cuda") + ", " +
                   std::to_string(tiling.tiles) + " tiles, " + std::to_string(place.workers) + " at once");
      const auto backend = place.make_tiled(tiling);
      const StageResults cut = run(*backend, points, settings);
      EXPECT_EQ(difference(whole.points, cut.points), "");
      EXPECT_EQ(difference(whole.normals, cut.normals), "");
      EXPECT_EQ(whole.counts.unmoved, cut.counts.unmoved);
      EXPECT_EQ(whole.counts.short_neighborhoods, cut.counts.short_neighborhoods);
      EXPECT_EQ(whole.held_back, cut.held_back);
    }
  }
}

Points cloud(int count) { return shapes::with_noise(shapes::sphere(count), 0.002); }

TEST(Tiles, has_the_bits_of_the_whole) { expect_the_same_in_tiles(cloud(200000), usual(), "plain"); }

TEST(Tiles, has_the_outliers_of_the_whole) {
  Points points = cloud(30000);
  for (std::size_t i = 0; i < points.size(); i += 100) {
    const float lift = 1 + 0.0001f * float(i % 997);
    points[i] = {points[i].x * lift, points[i].y * lift, points[i].z * lift};
  }
  StageSettings settings = usual();
  settings.neighbors = {0, 0.02f};
  settings.neighbors.min_neighbors = 16;
  settings.fairing.outlier_distance = 0.012f;
  settings.fairing.outlier_radius = 0.05f;
  settings.limits = {{0.008f, 0.012f}};
  for (const int iterations : {1, 2}) {
    settings.iterations = iterations;
    settings.fairing.pull_outliers = false;
    expect_the_same_in_tiles(points, settings, "kept");
    settings.fairing.pull_outliers = true;
    expect_the_same_in_tiles(points, settings, "pulled in");
  }
}

TEST(Tiles, knows_the_sensor_of_each_point) {
  const Points points = cloud(30000);
  StageSettings settings = usual();
  settings.neighbors = {0, 0.02f};
  settings.neighbors.min_neighbors = 16;
  settings.fairing.outlier_distance = 0.012f;
  settings.limits = {{0.04f, 0.06f}};
  settings.iterations = 2;
  settings.fairing.beam_width = 0.004f;
  settings.fairing.along_ray = true;
  SensorPlaces places{{{0.5f, 0.25f, 3.0f}}};
  settings.fairing.sensors = std::make_shared<const SensorPlaces>(places);
  expect_the_same_in_tiles(points, settings, "one sensor");
  places.places.clear();
  for (std::size_t i = 0; i < points.size(); ++i) places.places.push_back({2, float(i % 7), -3});
  settings.fairing.sensors = std::make_shared<const SensorPlaces>(places);
  expect_the_same_in_tiles(points, settings, "a sensor for each point");
}

TEST(Tiles, has_the_bits_of_the_whole_with_every_option) {
  const Points points = cloud(60000);
  StageSettings settings = usual();
  settings.fairing.area_weight = AreaWeight::squared;
  expect_the_same_in_tiles(points, settings, "area weight");
  settings.neighbors.k = 3;
  expect_the_same_in_tiles(points, settings, "area weight over more than the list");
  settings.neighbors = {8, 0, true, 0.012f};
  expect_the_same_in_tiles(points, settings, "constraint");
  settings.neighbors = {12, 0.02f, true, 0.008f};
  expect_the_same_in_tiles(points, settings, "constraint within a radius");
  settings.neighbors = {16, 0.015f, false, 0};
  expect_the_same_in_tiles(points, settings, "radius");
  settings.normals.filter_rounds = 2;
  settings.normals.crease_angle = 20;
  settings.fairing.symmetric = true;
  settings.fairing.turn_angle = 40;
  settings.fairing.strength = 0.9f;
  settings.iterations = 2;
  expect_the_same_in_tiles(points, settings, "filtered, both planes, two iterations");
  settings.neighbors = {30, 0, true, 0.012f};
  settings.iterations = 3;
  expect_the_same_in_tiles(points, settings, "constraint, filtered, both planes, three iterations");
}

TEST(Tiles, has_the_bits_of_the_whole_with_every_method) {
  const Points points = cloud(30000);
  for (const ParamInfo& info : kParams) {
    if (info.name != "method") continue;
    for (std::size_t start = 0; start < info.values.size();) {
      const std::string_view word = info.values.substr(start, info.values.find('|', start) - start);
      start += word.size() + 1;
      Params params;
      set_param(params, info, word);
      if (is_of_faces(params.method)) continue;  // this cloud has none
      StageSettings settings = usual();
      settings.neighbors.k = 12;
      settings.fairing.method = params.method;
      settings.fairing.area_weight = AreaWeight::length;
      settings.fairing.strength = 0.8f;
      expect_the_same_in_tiles(points, settings, std::string(word).c_str(), {{7, ~0ull, 0.05}});
    }
  }
}

TEST(Tiles, has_the_bits_of_the_whole_within_a_radius) {
  const Points points = cloud(30000);
  StageSettings settings = usual();
  settings.neighbors = {0, 0.04f, false, 0};
  settings.iterations = 2;
  expect_the_same_in_tiles(points, settings, "one radius");
  settings.normals = {{1.4f, true, 20}, 2};
  settings.fairing.closeness_sigma = 0.6f;
  settings.fairing.closeness_of_radius = settings.fairing.symmetric = true;
  settings.fairing.turn_angle = 40;
  settings.neighbors = {0, 0.02f, false, 0, 16};
  expect_the_same_in_tiles(points, settings, "radii that follow the density");
  expect_the_same_in_tiles(shapes::with_invalid(shapes::uneven(20000, 50), 11), settings, "uneven, invalid points");
  settings.normals.flat_scale = 1.8f;
  expect_the_same_in_tiles(points, settings, "radii that grow");
  expect_the_same_in_tiles(shapes::with_noise(shapes::cube(20000), 0.002), settings, "radii that grow on flat faces");
}

TEST(Tiles, has_the_bits_of_the_whole_where_lengths_follow_the_noise) {
  StageSettings settings = usual();
  settings.neighbors = {0, 0.012f, false, 0, 16};
  settings.normals = {{1.4f, true, 20, 1.6f}, 2};
  settings.fairing.closeness_sigma = 0.6f;
  settings.fairing.closeness_of_radius = settings.fairing.symmetric = true;
  settings.fairing.turn_angle = 40;
  settings.fairing.outlier_distance = 0.01f;
  settings.limits = {{0.006f, 0.01f}};
  settings.iterations = 2;
  follow_noise(settings, {-0.9f, -0.8f, -0.7f}, 1.5f, 0.003f);
  expect_the_same_in_tiles(shapes::with_noise(shapes::sphere(10000), 0.006), settings, "levels");
}

TEST(Tiles, has_the_bits_of_the_whole_over_thinned_neighbourhoods) {
  StageSettings settings = usual();
  settings.neighbors = {0, 0.2f, false, 0, 8};
  settings.normals = {{1.4f, true, 20}, 1};
  settings.fairing.closeness_sigma = 0.6f;
  settings.fairing.closeness_of_radius = settings.fairing.symmetric = true;
  settings.fairing.turn_angle = 40;
  expect_the_same_in_tiles(cloud(60000), settings, "thinned neighbourhoods", {{5, ~0ull, 0.3}});
}

TEST(Tiles, has_the_bits_of_the_whole_on_hard_clouds) {
  expect_the_same_in_tiles(shapes::with_invalid(cloud(20000), 7), usual(), "invalid points");
  expect_the_same_in_tiles(shapes::with_stray(cloud(20000), 1e6f), usual(), "a stray point");
  expect_the_same_in_tiles(shapes::uneven(20000, 200), usual(), "uneven");
  expect_the_same_in_tiles(shapes::grid(20), usual(), "a grid, full of ties");
  expect_the_same_in_tiles(shapes::flat_grid(100), usual(), "a flat grid");
  expect_the_same_in_tiles(shapes::line(5000), usual(), "a line");
  Points some_identical = cloud(20000);
  for (std::size_t i = 0; i < some_identical.size(); i += 5) some_identical[i] = {0.5f, 0.25f, 0.125f};
  expect_the_same_in_tiles(some_identical, usual(), "a fifth identical");
  for (const int count : {0, 1, 2, 9, 100}) expect_the_same_in_tiles(cloud(count), usual(), "tiny");
  expect_the_same_in_tiles(shapes::identical(3000), usual(), "identical points");
}

TEST(Tiles, has_the_bits_of_the_whole_where_little_may_be_uploaded) {
  expect_the_same_in_tiles(cloud(60000), usual(), "a limit", {{2, 15000}, {3, 9000}});
}

TEST(Tiles, that_a_far_point_keeps_from_being_cut_is_an_error_and_no_wrong_cloud) {
  const Points points = shapes::with_stray(cloud(20000), 1e6f);
  const auto backend = Place{Device::cpu, 1}.make_tiled({4, 12000});
  expect_error(ErrorKind::memory, "", [&] { run(*backend, points, usual()); });
}

TEST(Tiles, has_the_estimates_of_the_whole) {
  const Points points = shapes::with_invalid(cloud(50000), 9);
  std::vector<std::uint32_t> queries;
  for (std::uint32_t i = 0; i < 50000; i += 77) queries.push_back(i);
  for (const Place& place : places()) {
    const auto whole = place.make(), cut = place.make_tiled({5, ~0ull, 0.1});
    for (Backend* backend : {whole.get(), cut.get()}) {
      backend->upload(points, IndexOrder::fastest);
      backend->build_index(0, {}, {});
    }
    for (const int k : {6, 30, 600}) {
      Points expected(queries.size() * std::size_t(k + 1)), rows = expected;
      whole->sampling().sample_neighborhoods(queries, k, expected);
      cut->sampling().sample_neighborhoods(queries, k, rows);
      for (std::size_t i = 0; i < rows.size(); ++i)
        if (std::isnan(expected[i].x) && std::isnan(rows[i].x)) rows[i] = expected[i] = {};
      EXPECT_EQ(difference(expected, rows), "") << k;
    }
    const CloudSample a = whole->sampling().sample_cloud(500), b = cut->sampling().sample_cloud(500);
    EXPECT_EQ(difference({a.bounds.min, a.bounds.max}, {b.bounds.min, b.bounds.max}), "");
    EXPECT_EQ(a.bounds.valid, b.bounds.valid);
    EXPECT_EQ(difference(a.points, b.points), "");
  }
}

}  // namespace
}  // namespace pointfair
