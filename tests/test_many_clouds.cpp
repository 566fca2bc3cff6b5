// SPDX-License-Identifier: Apache-2.0
// Many clouds in one call against a run of each, bit for bit, on the CPU and, where there is one, on a card.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "pointfair/pointfair.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

struct Clouds {
  std::vector<Point> points;
  std::vector<std::uint64_t> offsets{0};

  void add(int count, float scale, float x) {
    shapes::Random random(std::uint64_t(count) + 7);
    for (const Point& p : shapes::sphere(count, std::uint64_t(count) + 1)) {
      const float r = scale * float(1 + 0.01 * random.normal());
      points.push_back({x + p.x * r, p.y * r, p.z * r});
    }
    offsets.push_back(points.size());
  }
  std::span<const Point> cloud(std::size_t i) const {
    return std::span(points).subspan(offsets[i], offsets[i + 1] - offsets[i]);
  }
  std::size_t count() const { return offsets.size() - 1; }
};

// Clouds that lie in each other, of every size about the leaves and groups of a tree; one in one place, one of a line,
// one with invalid points.
Clouds mixed_clouds() {
  Clouds clouds;
  for (const int size : {0, 1, 2, 5, 31, 32, 33, 1000, 1023, 1024, 1025, 2048, 3000, 0, 7777, 10240})
    clouds.add(size, size % 3 == 0 ? 0.3f : 1.0f, size % 2 == 0 ? 0.0f : 0.4f);
  for (int i = 0; i < 500; ++i) clouds.points.push_back({1, 2, 3});
  clouds.offsets.push_back(clouds.points.size());
  for (int i = 0; i < 500; ++i) clouds.points.push_back({float(i), 0, 0});
  clouds.offsets.push_back(clouds.points.size());
  clouds.add(900, 1, 0);
  for (std::size_t i = 0; i < 900; i += 7)
    clouds.points[clouds.points.size() - 900 + i].y = i % 2 == 0 ? std::numeric_limits<float>::quiet_NaN() : 1e30f;
  clouds.add(40000, 1, 0);  // too large to be computed with the others
  clouds.add(700, 1, 0);
  return clouds;
}

Params given(int k) {
  Params params;
  params.k = k;
  params.normal_sigma = 0.2;
  params.closeness_sigma = 0.1;
  params.similarity_sigma = 0.03;
  return params;
}

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
  Params estimated;
  estimated.k = 8;
  kinds.push_back(estimated);
  kinds.push_back(Params{});
  return kinds;
}

void expect_bits_of_single_runs(Device device, const std::vector<Params>& kinds) {
  const Clouds clouds = mixed_clouds();
  Pipeline many(device), single(device);
  for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
    std::vector<Point> result(clouds.points.size());
    many.run_many(clouds.points, clouds.offsets, kinds[kind], result);
    for (std::size_t i = 0; i < clouds.count(); ++i) {
      std::vector<Point> expected(clouds.cloud(i).size());
      single.load(clouds.cloud(i));
      single.run(kinds[kind], expected);
      EXPECT_EQ(std::memcmp(expected.data(), result.data() + clouds.offsets[i], expected.size() * sizeof(Point)), 0)
          << "parameters " << kind << ", cloud " << i << " of " << expected.size();
    }
  }
}

TEST(ManyClouds, have_the_bits_of_single_runs) {
  const std::vector<Params> kinds = kinds_of_params();
  expect_bits_of_single_runs(Device::cpu, {kinds[1], kinds.back()});
}

TEST(ManyClouds, that_contradict_themselves_are_refused) {
  const std::vector<Point> points = shapes::sphere(100);
  std::vector<Point> out(points.size());
  Pipeline pipeline(Device::cpu);
  const auto error_of = [&](std::vector<std::uint64_t> offsets) -> std::string {
    try {
      pipeline.run_many(points, offsets, given(8), out);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::usage);
      return error.what();
    }
    return "";
  };
  EXPECT_NE(error_of({}).find("begin with 0"), std::string::npos);
  EXPECT_NE(error_of({0, 99}).find("end with the number of points, 100"), std::string::npos);
  EXPECT_NE(error_of({0, 60, 50, 100}).find("must not decrease"), std::string::npos);
  EXPECT_EQ(error_of({0, 50, 100}), "");
  EXPECT_FALSE(pipeline.runs_together(given(8)));
}

TEST(CudaManyClouds, have_the_bits_of_single_runs) {
  std::string reason = "no card";
  for (const DeviceStatus& status : list_devices())
    if (status.info.kind == Device::cuda) reason = status.usable ? "" : status.info.reason;
  if (!reason.empty()) GTEST_SKIP() << reason;
  const std::vector<Params> kinds = kinds_of_params();
  Pipeline pipeline(Device::cuda);
  EXPECT_TRUE(pipeline.runs_together(kinds[0]));
  EXPECT_FALSE(pipeline.runs_together(Params{}));
  expect_bits_of_single_runs(Device::cuda, kinds);
}

// More than go into one upload, each too small for a leaf.
TEST(CudaManyClouds, of_any_number_have_the_bits_of_single_runs) {
  std::string reason = "no card";
  for (const DeviceStatus& status : list_devices())
    if (status.info.kind == Device::cuda) reason = status.usable ? "" : status.info.reason;
  if (!reason.empty()) GTEST_SKIP() << reason;
  Clouds clouds;
  for (int i = 0; i < 5000; ++i) clouds.add(20 + i % 60, 1, 0);
  std::vector<Point> result(clouds.points.size()), expected(clouds.points.size());
  Pipeline(Device::cuda).run_many(clouds.points, clouds.offsets, given(8), result);
  Pipeline(Device::cpu).run_many(clouds.points, clouds.offsets, given(8), expected);
  EXPECT_EQ(std::memcmp(result.data(), expected.data(), result.size() * sizeof(Point)), 0);
}

}  // namespace
}  // namespace pointfair
