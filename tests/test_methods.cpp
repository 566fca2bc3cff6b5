// SPDX-License-Identifier: Apache-2.0
// The methods other than the bilateral one (docs/methods.md) against tests/reference.h, and what each must do to clouds
// whose right answer is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "pointfair/pipeline.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {

namespace {

using reference::distance, reference::rms;
using reference::Vec;
using shapes::Points;

constexpr Method kMethods[] = {Method::laplacian, Method::taubin, Method::hc_laplacian,
                               Method::mls,       Method::wiener, Method::mollified};

Params with(Method method) { return {.method = method}; }

double radial(Point p) { return reference::length(reference::to_vec(p)) - 1; }

class Methods : public testing::TestWithParam<Method> {
 protected:
  Method method() const { return GetParam(); }

  // The least gap among the normals that decide where a point goes: rounding turns them by 1e-6 / gap^2.
  double least_gap(const std::vector<reference::Faired>& expected, std::size_t i, const reference::List& list) const {
    double gap = moves_along_normal(method()) ? expected[i].normal.gap : 1;
    if (method() == Method::wiener || method() == Method::mollified)
      for (const std::uint32_t j : list)
        if (expected[j].neighbors >= 3) gap = std::min(gap, expected[j].normal.gap);
    return gap;
  }

  // A wrong neighbour, weight or sign shows by far more: displacements are about a tenth of sigma_c.
  void expect_like_reference(const Points& points, const Params& params, const std::string& what) const {
    const Ran result(points, params);
    const reference::Settings settings = reference::settings_of(result.report.params);
    const std::vector<reference::Faired> expected = reference::fair(points, settings);
    std::size_t compared = 0, too_few = 0, without_normal = 0;
    double moved = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!reference::is_valid(points[i])) continue;
      const reference::List list = reference::neighborhood(points, i, settings);
      too_few += list.size() < 3;
      without_normal += list.size() >= 3 && expected[i].normal.gap == 0;
      const double gap = list.size() < 3 ? 1 : least_gap(expected, i, list);
      if (gap < 0.02) continue;
      ++compared;
      const double size = reference::closeness_sigma(points, i, settings);
      const double off = reference::length(reference::to_vec(result.points[i]) - expected[i].position);
      moved += distance(result.points[i], points[i]) / size;
      ASSERT_LE(off, 3e-7 + size * (1e-5 + 1e-6 / (gap * gap)))
          << what << ", point " << i << ", gap " << gap << ", size " << size;
    }
    EXPECT_GT(compared, points.size() / 2) << what;
    EXPECT_GT(moved, 0.01 * double(compared)) << what;
    EXPECT_EQ(result.report.unmoved.too_few_neighbors, too_few) << what;
    EXPECT_EQ(result.report.unmoved.no_normal, moves_along_normal(method()) ? without_normal : 0) << what;
  }
};

INSTANTIATE_TEST_SUITE_P(All, Methods, testing::ValuesIn(kMethods), [](const auto& method) {
  std::string name = param_text({.method = method.param}, *find_param("method"));
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

const Points& hills() {
  static const Points points = shapes::with_noise(shapes::waves(900), 0.006);  // spacing about 0.045
  return points;
}

TEST_P(Methods, agree_with_the_reference_over_lists) {
  for (const int k : {12, 30, 100})
    for (const AreaWeight area : {AreaWeight::none, AreaWeight::squared}) {
      Params params = with(method());
      params.k = k;
      params.iterations = 1;
      params.relaxation = 0.8;
      params.area_weight = area;
      params.similarity_sigma = 0.01;
      expect_like_reference(hills(), params, "k " + std::to_string(k) + ", area " + std::to_string(int(area)));
    }
}

TEST_P(Methods, agree_with_the_reference_within_a_radius) {
  Params params = with(method());
  params.iterations = 1;
  params.radius = 0.15;
  params.closeness_sigma = 0.07;
  params.area_weight = AreaWeight::length;
  expect_like_reference(hills(), params, "one radius");
  params.radius = 0.1;
  params.min_neighbors = 12;
  params.closeness_sigma = {0.7, Length::Unit::radius};
  expect_like_reference(shapes::with_noise(shapes::uneven(900, 20), 0.004), params, "uneven");
}

TEST_P(Methods, agree_with_the_reference_for_automatic_parameters_and_iterations) {
  for (const Points& points : {hills(), shapes::with_noise(shapes::sphere(1200), 0.01)}) {
    Params params = with(method());
    expect_like_reference(points, params, "automatic");
    params.iterations = 2;
    params.k = 20;
    expect_like_reference(points, params, "two iterations");
  }
}

TEST_P(Methods, agree_with_the_reference_beside_invalid_and_lonely_points) {
  Points points = shapes::with_invalid(hills(), 7);
  points.push_back({5, 5, 5});
  points.push_back({5.01f, 5, 5});
  Params params = with(method());
  params.iterations = 1;
  params.radius = 0.2;
  params.min_neighbors = 1;
  params.closeness_sigma = 0.1;
  const Ran result(points, params);
  EXPECT_EQ(distance(result.points.back(), points.back()), 0) << "it has one neighbour";
  expect_like_reference(points, params, "invalid and lonely");
}

TEST_P(Methods, commute_with_scaling_and_moving) {
  Params params = with(method());
  params.iterations = 1;
  params.k = 16;
  params.closeness_sigma = 0.1;
  params.normal_sigma = 0.1;
  params.similarity_sigma = 0.01;
  const Points once = Ran(hills(), params).points;

  Params larger = params;
  for (Length* length : {&larger.closeness_sigma, &larger.normal_sigma, &larger.similarity_sigma})
    length->value *= 1024;
  const Points scaled = Ran(shapes::scaled(hills(), 1024), larger).points, wanted = shapes::scaled(once, 1024);
  EXPECT_EQ(std::memcmp(scaled.data(), wanted.data(), wanted.size() * sizeof(Point)), 0);

  const auto turned = [](const Points& points) {  // by the angle of a 3-4-5 triangle, axes exchanged, and away
    Points result;
    for (const Point& p : points)
      result.push_back(shapes::make_point(0.6 * p.x - 0.8 * p.y + 2, p.z - 1, 0.8 * p.x + 0.6 * p.y + 3));
    return result;
  };
  const Points a = Ran(turned(hills()), params).points, b = turned(once);
  std::size_t apart = 0;
  for (std::size_t i = 0; i < a.size(); ++i) apart += distance(a[i], b[i]) > 2e-5;
  EXPECT_LT(apart, a.size() / 100);  // normals that the data hardly determines, and ties
}

TEST_P(Methods, leave_a_clean_plane_plane) {
  for (const bool list : {true, false}) {
    Params params = with(method());
    if (list) params.k = 20;
    const Points points = shapes::plane(5000);
    for (const Point& p : Ran(points, params).points) ASSERT_EQ(p.z, 0);
    Points leaning;
    for (const Point& p : points) leaning.push_back(shapes::make_point(p.x, p.y, 0.5 * p.x - 0.25 * p.y));
    for (const Point& p : Ran(leaning, params).points) ASSERT_NEAR(p.z, 0.5 * p.x - 0.25 * p.y, 1e-6);
  }
}

TEST_P(Methods, with_nothing_set_leave_clean_clouds_nearly_as_they_are) {
  for (const Points& points : {shapes::sphere(20000), shapes::waves(20000)}) {
    const Ran result(points, with(method()));
    EXPECT_LT(shapes::mean_distance(result.points, points),
              0.05 * reference::spacing(shapes::sphere(2000)) / std::sqrt(10));
  }
}

TEST_P(Methods, with_nothing_set_halve_the_noise_of_a_sphere_and_of_a_plane) {
  const Points sphere = shapes::with_noise(shapes::sphere(20000), 0.01);
  EXPECT_LT(rms(Ran(sphere, with(method())).points, radial), 0.5 * rms(sphere, radial));
  const Points plane = shapes::with_noise(shapes::plane(20000), 0.005);
  const auto height = [](Point p) { return double(p.z); };
  EXPECT_LT(rms(Ran(plane, with(method())).points, height), 0.5 * rms(plane, height));
}

TEST_P(Methods, move_points_without_a_normal_unless_they_need_one) {
  Params params = with(method());
  params.k = 8;
  params.iterations = 1;
  const Points points = shapes::line(500);
  const Ran result(points, params);
  const double moved = shapes::mean_distance(result.points, points);
  const bool needs_normals = moves_along_normal(method()) || method() == Method::mollified;
  EXPECT_EQ(moved == 0, needs_normals);
  EXPECT_EQ(result.report.unmoved.no_normal, moves_along_normal(method()) ? points.size() : 0);
}

// Volume lost by a sphere without noise, over the same neighbourhoods.
double shrinkage(Method method) {
  Params params{.k = 40, .method = method, .iterations = 5};
  params.relaxation = method == Method::taubin ? 0.63 : 1;
  double sum = 0;
  const Points points = Ran(shapes::sphere(5000), params).points;
  for (const Point& p : points) sum -= radial(p);
  return sum / double(points.size());
}

TEST(Shrinkage, of_taubin_and_hc_is_a_small_part_of_that_of_laplacian) {
  const double laplacian = shrinkage(Method::laplacian);
  EXPECT_GT(laplacian, 0.01);
  EXPECT_LT(std::abs(shrinkage(Method::taubin)), 0.1 * laplacian);
  EXPECT_LT(std::abs(shrinkage(Method::hc_laplacian)), 0.1 * laplacian);
}

TEST(MovingLeastSquares, leaves_a_paraboloid_where_it_is_which_planes_do_not) {
  Points points = shapes::plane(4000);
  const auto height = [](Point p) { return 0.8 * (p.x - 0.5) * (p.x - 0.5) - 0.5 * (p.y - 0.5) * (p.x - 0.25); };
  for (Point& p : points) p.z = float(height(p));
  const auto error = [&](Point p) { return std::abs(p.z - height(p)); };
  Params params{.k = 60, .method = Method::mls, .iterations = 1};
  const double mls = rms(Ran(points, params).points, error);
  params.method = Method::wiener;
  params.similarity_sigma = 1;  // all is noise: projects onto planes
  const double planes = rms(Ran(points, params).points, error);
  EXPECT_LT(mls, 0.03 * planes);
  EXPECT_LT(mls, 2e-5);
}

TEST(Wiener, keeps_heights_beyond_what_noise_explains) {
  const Points points = shapes::with_noise(shapes::cube(10000), 0.005);
  Params params{.k = 40, .method = Method::wiener, .relaxation = 1, .iterations = 1};
  const auto mean_move = [&](double noise) {
    params.similarity_sigma = noise;
    return shapes::mean_distance(Ran(points, params).points, points);
  };
  const double all = mean_move(1);
  EXPECT_LT(mean_move(0.0005), 0.1 * all);
  EXPECT_LT(mean_move(0.005), 0.95 * all);
  EXPECT_GT(mean_move(0.005), 0.5 * all);
}

TEST(Mollified, keeps_an_edge_that_the_laplacian_rounds) {
  const Points points = shapes::cube(20000);
  const auto off_cube = [](Point p) {
    const double q[3] = {std::abs(p.x - 0.5), std::abs(p.y - 0.5), std::abs(p.z - 0.5)};
    return 0.5 - std::max({q[0], q[1], q[2]});
  };
  Params params{.k = 40, .method = Method::laplacian, .similarity_sigma = 0.005, .iterations = 1};
  const double laplacian = rms(Ran(points, params).points, off_cube);
  params.method = Method::mollified;
  EXPECT_LT(rms(Ran(points, params).points, off_cube), 0.5 * laplacian);
}

}  // namespace
}  // namespace pointfair
