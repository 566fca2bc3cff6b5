// SPDX-License-Identifier: Apache-2.0
// The same points and parameters give the same bits on any number of threads.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points, shapes::same_bits;

std::vector<Params> all_kinds() {
  Params by_radius{.radius = Length(3, Length::Unit::spacing), .area_weight = AreaWeight::length};
  Params both = by_radius;
  both.k = 24;
  Params long_list{.k = 64};
  std::vector<Params> kinds{Params{}, paper_preset(), by_radius, both, long_list};
  for (const Method method :
       {Method::laplacian, Method::taubin, Method::hc_laplacian, Method::mls, Method::wiener, Method::mollified})
    kinds.emplace_back().method = method;
  return kinds;
}

std::vector<Points> clouds() {
  return {shapes::with_noise(shapes::waves(12000), 0.004), shapes::with_noise(shapes::uneven(9000, 1000), 0.0005),
          shapes::with_invalid(shapes::sphere(9000), 11), shapes::flat_grid(60),
          shapes::with_stray(shapes::cube(5000), 1e6f)};
}

TEST(Determinism, one_two_and_seven_threads_give_the_same_bits) {
  for (const Points& points : clouds())
    for (const Params& params : all_kinds()) {
      Ran one(points, params, 1);
      const Points normals = one.normals();
      for (const unsigned threads : {2u, 7u}) {
        SCOPED_TRACE(std::to_string(threads) + " threads, " + std::to_string(points.size()) + " points");
        Ran many(points, params, threads);
        ASSERT_TRUE(same_bits(many.points, one.points));
        ASSERT_TRUE(same_bits(many.normals(), normals));
        ASSERT_EQ(many.report.unmoved, one.report.unmoved);
      }
    }
}

}  // namespace
}  // namespace pointfair
