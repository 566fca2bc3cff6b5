// SPDX-License-Identifier: Apache-2.0
// The same points and parameters give the same bits.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "pointfair/pipeline.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points, shapes::same_bits;

struct Result {
  Points points, normals;
};

Result run(Pipeline& pipeline, const Points& points, const Params& params) {
  Result result{Points(points.size()), Points(points.size())};
  pipeline.run(params, result.points);
  pipeline.normals(result.normals);
  return result;
}

Pipeline loaded(const Points& points, unsigned threads) {
  Pipeline pipeline(Device(Device::cpu, 0, threads));
  pipeline.load(points);
  return pipeline;
}

std::vector<Params> all_kinds() {
  Params by_radius;
  by_radius.radius = Length(3, Length::Unit::spacing);
  by_radius.area_weight = AreaWeight::length;
  Params both = by_radius;
  both.k = 24;
  Params long_list;
  long_list.k = 64;
  return {Params{}, paper_preset(), by_radius, both, long_list};
}

std::vector<Points> clouds() {
  return {shapes::with_noise(shapes::waves(12000), 0.004), shapes::with_noise(shapes::uneven(9000, 1000), 0.0005),
          shapes::with_invalid(shapes::sphere(9000), 11), shapes::flat_grid(60),
          shapes::with_stray(shapes::cube(5000), 1e6f)};
}

TEST(Determinism, one_two_and_seven_threads_give_the_same_bits) {
  for (const Points& points : clouds())
    for (const Params& params : all_kinds()) {
      Pipeline one = loaded(points, 1);
      const Result expected = run(one, points, params);
      for (const unsigned threads : {2u, 7u}) {
        Pipeline many = loaded(points, threads);
        const Result found = run(many, points, params);
        ASSERT_TRUE(same_bits(found.points, expected.points)) << threads << " threads, " << points.size() << " points";
        ASSERT_TRUE(same_bits(found.normals, expected.normals))
            << threads << " threads, " << points.size() << " points";
        ASSERT_EQ(many.report().unmoved, one.report().unmoved);
      }
    }
}

TEST(Determinism, a_second_run_and_a_second_load_give_the_same_bits) {
  for (const Points& points : clouds()) {
    Pipeline pipeline = loaded(points, 2);
    const Result expected = run(pipeline, points, {});
    EXPECT_TRUE(same_bits(run(pipeline, points, {}).points, expected.points));
    pipeline.load(shapes::cube(3000));
    pipeline.run();
    pipeline.load(points);
    EXPECT_TRUE(same_bits(run(pipeline, points, {}).points, expected.points));
  }
}

TEST(Determinism, invalid_points_come_back_with_their_own_bits) {
  const Points points = shapes::with_invalid(shapes::sphere(9000), 11);
  Pipeline pipeline = loaded(points, 2);
  const Result result = run(pipeline, points, {});
  for (std::size_t i = 0; i < points.size(); i += 11)
    ASSERT_EQ(std::memcmp(&result.points[i], &points[i], sizeof(Point)), 0) << "point " << i;
}

}  // namespace
}  // namespace pointfair
