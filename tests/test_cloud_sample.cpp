// SPDX-License-Identifier: Apache-2.0
// The sample of a cloud: a function of the set of its points, spread as they are, that moves with them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "scale/candidates.hpp"
#include "seam/backend.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/sampling.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

CloudSample sample_of(const Points& points, std::size_t count, bool indexed = false) {
  const auto backend = make_cpu_backend(2);
  backend->upload(points, IndexOrder::fastest);
  if (indexed) backend->build_index(0, {}, {});
  return backend->sampling().sample_cloud(count);
}

std::vector<Points> clouds() {
  Points copies = shapes::sphere(3000);
  for (std::size_t i = 0; i < 1500; ++i) copies[2 * i] = copies[0];
  return {shapes::with_noise(shapes::waves(20000), 0.01),
          shapes::with_invalid(shapes::sphere(5000), 7),
          shapes::with_stray(shapes::sphere(5000), -1e7f),
          shapes::grid(20),
          copies,
          shapes::identical(100),
          {}};
}

TEST(CloudSample, is_the_same_for_any_order_of_the_points_and_from_the_index) {
  for (const Points& points : clouds()) {
    const Points found = sample_of(points, 700).points;
    const Points shuffled = shapes::permuted(points, shapes::shuffle_order(points.size(), 5));
    EXPECT_TRUE(shapes::same_bits(found, sample_of(shuffled, 700).points));
    EXPECT_TRUE(shapes::same_bits(found, sample_of(points, 700, true).points));
    const CloudSample more = sample_of(points, 1400);
    EXPECT_TRUE(more.points.size() < found.size() ||
                shapes::same_bits(found, {more.points.begin(), more.points.begin() + std::ptrdiff_t(found.size())}));
    for (std::size_t i = 0; i < more.points.size(); ++i)
      EXPECT_EQ(std::memcmp(&points[more.indices[i]], &more.points[i], sizeof(Point)), 0);
  }
}

TEST(CloudSample, has_as_many_points_as_asked_for_or_one_of_each_place) {
  EXPECT_EQ(sample_of(clouds()[0], 700).points.size(), 700u);
  EXPECT_EQ(sample_of(clouds()[2], 700).points.size(), 700u) << "beside a stray point";
  EXPECT_EQ(sample_of(clouds()[4], 5000).points.size(), 1501u) << "half of them copies";
  EXPECT_EQ(sample_of(shapes::identical(100), 50).points.size(), 1u);
  EXPECT_EQ(sample_of(shapes::sphere(300), 700).points.size(), 300u);
}

// Cells of a tenth of the square: as many of the sample in each as of the cloud, but for chance.
TEST(CloudSample, is_spread_as_the_cloud_is) {
  const Points points = shapes::uneven(50000, 50);
  const CloudSample sample = sample_of(points, 5000);
  for (const auto axis : {&Point::x, &Point::y, &Point::z}) {
    Points sorted = points;
    std::sort(sorted.begin(), sorted.end(), [&](const Point& a, const Point& b) { return a.*axis < b.*axis; });
    for (int tenth = 1; tenth < 10; ++tenth) {
      const float border = sorted[sorted.size() * std::size_t(tenth) / 10].*axis;
      const auto below =
          std::count_if(sample.points.begin(), sample.points.end(), [&](const Point& p) { return p.*axis < border; });
      EXPECT_NEAR(double(below), 500.0 * tenth, 5 * std::sqrt(5000 * 0.25)) << tenth;
    }
  }
}

// Coordinates are multiples of 2^-12, so that every sum is exact.
TEST(CloudSample, of_a_cloud_moved_exactly_is_moved_with_it) {
  Points points = shapes::with_noise(shapes::waves(20000), 0.01);
  for (Point& p : points)
    p = {std::round(p.x * 4096) / 4096, std::round(p.y * 4096) / 4096, std::round(p.z * 4096) / 4096};
  const Point by{37.25f, -1024.5f, 3.0009765625f};
  EXPECT_TRUE(shapes::same_bits(shapes::shifted(sample_of(points, 900).points, by),
                                sample_of(shapes::shifted(points, by), 900).points));
}

// As by another file format: hardly any point changes its cell.
TEST(CloudSample, of_a_cloud_rounded_anew_is_nearly_the_same) {
  const Points points = shapes::with_noise(shapes::waves(20000), 0.01);
  const Points there = shapes::shifted(points, {0.7f, 0.3f, 0.1f});
  const CloudSample before = sample_of(points, 1000), after = sample_of(there, 1000);
  const std::set<std::uint32_t> kept(before.indices.begin(), before.indices.end());
  const auto same =
      std::count_if(after.indices.begin(), after.indices.end(), [&](std::uint32_t i) { return kept.contains(i); });
  EXPECT_GT(same, 950);
}

// Where many points share cells, the first candidates are too few.
TEST(CloudSample, is_drawn_in_one_pass_over_a_stored_cloud) {
  Points shared;
  for (const Point& p : shapes::waves(4000)) shared.insert(shared.end(), 2, p);
  for (const Points& points : {shapes::waves(20000), shared, shapes::with_stray(shapes::sphere(20000), -1e4f)}) {
    const CloudSample expected = sample_of(points, 900);
    int passes = 0;
    const auto for_all = [&](const std::function<void(std::span<const Point>)>& visit) {
      ++passes;
      visit(std::span(points).first(1000));
      visit(std::span(points).subspan(1000));
    };
    scale::CandidatesAhead candidates(expected.bounds, for_all, [](std::size_t count, const auto& body) {
      for (std::size_t i = 0; i < count; ++i) body(i);
    });
    const CloudSample found =
        draw_sample(expected.bounds, 900, [&](Candidates wanted) { return candidates.collect(wanted); });
    EXPECT_EQ(passes, 1);
    EXPECT_TRUE(shapes::same_bits(found.points, expected.points));
  }
}

}  // namespace
}  // namespace pointfair
