// SPDX-License-Identifier: Apache-2.0
// Many clouds in one call against a run of each, bit for bit, on the CPU and, where there is one, on a card.
#include <gtest/gtest.h>

#include <limits>

#include "many_shapes.h"
#include "pointfair/pointfair.hpp"
#include "runs.h"

namespace pointfair {
namespace {

using shapes::Clouds;

Params given(int k) { return {.k = k, .normal_sigma = 0.2, .closeness_sigma = 0.1, .similarity_sigma = 0.03}; }

std::vector<Params> kinds_of_params() {
  std::vector<Params> kinds;
  for (const int k : {3, 8, 16, 24, 40}) kinds.push_back(given(k));
  for (const int iterations : {1, 2, 3}) {
    kinds.push_back(given(8));
    kinds.back().iterations = iterations;
  }
  kinds.push_back(given(12));
  kinds.back().normal_filter = NormalFilter::on;
  kinds.back().crease_angle = 30;
  kinds.back().offset = Offset::symmetric;
  kinds.push_back(given(8));
  kinds.back().area_weight = AreaWeight::squared;
  kinds.push_back(given(8));
  kinds.back().radius = 0.05;
  kinds.push_back(given(8));
  kinds.back().outliers = Outliers::keep;
  kinds.back().outlier_distance = 0.05;
  kinds.back().displacement_limit = 0.02;
  kinds.push_back({.k = 8});
  kinds.push_back(Params{});
  return kinds;
}

void expect_bits_of_single_runs(Device device, const Clouds& clouds, const std::vector<Params>& kinds) {
  Pipeline many(device), single(device);
  for (std::size_t kind = 0; kind < kinds.size(); ++kind)
    shapes::expect_bits_of_single_runs(many, single, clouds, kinds[kind], "parameters " + std::to_string(kind));
}

TEST(ManyClouds, have_the_bits_of_single_runs) {
  const std::vector<Params> kinds = kinds_of_params();
  expect_bits_of_single_runs(Device::cpu, shapes::mixed_clouds(), {kinds[1], kinds.back()});
}

TEST(ManyClouds, that_contradict_themselves_are_refused) {
  const std::vector<Point> points = shapes::sphere(100);
  std::vector<Point> out(points.size());
  Pipeline pipeline(Device::cpu);
  const auto refused = [&](std::vector<std::uint64_t> offsets, const std::string& part) {
    expect_error(ErrorKind::usage, part, [&] { pipeline.run_many(points, offsets, given(8), out); });
  };
  refused({}, "begin with 0");
  refused({0, 99}, "end with the number of points, 100");
  refused({0, 60, 50, 100}, "must not decrease");
  EXPECT_NO_THROW(pipeline.run_many(points, std::vector<std::uint64_t>{0, 50, 100}, given(8), out));
  EXPECT_FALSE(pipeline.runs_together(given(8)));
}

TEST(ManyClouds, that_are_refused_or_stopped_leave_what_was_loaded_or_nothing) {
  const std::vector<Point> points = shapes::sphere(100);
  const std::vector<std::uint64_t> offsets{0, 50, 100};
  std::vector<Point> out(points.size());
  Pipeline pipeline(Device::cpu);
  pipeline.load(Cloud{.origin = {1000, 0, 0}, .points = points});
  expect_error(ErrorKind::usage, "", [&] { pipeline.run(points, {.k = -5}, out); });
  expect_error(ErrorKind::usage, "", [&] { pipeline.run_many(points, offsets, {.k = -5}, out); });
  EXPECT_EQ(pipeline.run({}).origin[0], 1000);
  std::stop_source stop;
  stop.request_stop();
  expect_error(ErrorKind::interrupted, "", [&] { pipeline.run_many(points, offsets, {}, out, stop.get_token()); });
  EXPECT_EQ(pipeline.run({}).points.size(), 0u);
}

TEST(CudaManyClouds, have_the_bits_of_single_runs) {
  if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
  const std::vector<Params> kinds = kinds_of_params();
  Pipeline pipeline(Device::cuda);
  EXPECT_TRUE(pipeline.runs_together(kinds[0]));
  EXPECT_TRUE(pipeline.runs_together(Params{}));
  EXPECT_FALSE(pipeline.runs_together(kinds[kinds.size() - 2]));  // lists of estimated widths
  expect_bits_of_single_runs(Device::cuda, shapes::mixed_clouds(), slow_tools::some_of(kinds));
}

TEST(CudaManyClouds, with_estimates_of_each_have_the_bits_of_single_runs) {
  if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
  expect_bits_of_single_runs(Device::cuda, shapes::clouds_with_estimates(),
                             slow_tools::some_of(shapes::params_with_estimates()));
}

void expect_bits_of_the_cpu(const Clouds& clouds, const Params& params) {
  std::vector<Point> result(clouds.points.size()), expected(clouds.points.size());
  Pipeline(Device::cuda).run_many(clouds.points, clouds.offsets, params, result);
  Pipeline(Device::cpu).run_many(clouds.points, clouds.offsets, params, expected);
  EXPECT_TRUE(shapes::same_bits(result, expected));
}

// More than are measured together.
TEST(CudaManyClouds, of_any_number_with_estimates_have_the_bits_of_the_cpu) {
  if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
  Clouds clouds;
  for (int i = 0; i < int(slow_tools::most_points(600)); ++i)
    clouds.add(200 + i % 90, 1, 0, 0.002f * float(1 + i % 17));
  expect_bits_of_the_cpu(clouds, {});
}

// More than go into one upload, each too small for a leaf.
TEST(CudaManyClouds, of_any_number_have_the_bits_of_single_runs) {
  if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
  Clouds clouds;
  for (int i = 0; i < int(slow_tools::most_points(5000)); ++i) clouds.add(20 + i % 60, 1, 0);
  expect_bits_of_the_cpu(clouds, given(8));
}

}  // namespace
}  // namespace pointfair
