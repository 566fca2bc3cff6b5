// SPDX-License-Identifier: Apache-2.0
// Whole runs on small clouds against tests/reference.h: positions, normals and counts, for every kind of neighbourhood
// and every switch.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ostream>
#include <string>
#include <vector>

#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

// Normals that the data hardly determines cannot agree: rounding turns them by 1e-6 / gap^2 (tests/test_point.cpp).
constexpr double kLeastComparedGap = 0.01;

// Positions may differ by the float grid around the point, by 2e-6 of the neighbourhood's size for the sums, and by the
// turn of the normal times that size. `size` is the larger of the closeness sigma and the spacing.
double allowed(Point p, double size, double gap) {
  const double largest = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  return 1.2e-7 * largest + size * (2e-6 + 1e-6 / (gap * gap));
}

double mean_radius(const Points& points, const reference::Settings& settings) {
  double sum = 0, valid = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!reference::is_valid(points[i])) continue;
    sum += std::sqrt(reference::squared_radius(points, i, settings));
    ++valid;
  }
  return sum / valid;
}

// A wrong neighbour or weight shows by far more than `allowed`.
void expect_like_reference(const Points& points, const Params& params, const std::string& what) {
  Pipeline pipeline = loaded(points);
  Points out(points.size()), normals(points.size());
  pipeline.run(params, out);
  pipeline.normals(normals);
  const reference::Settings settings =
      reference::settings_of(pipeline.report().params, PipelineAccess::followed_noise(pipeline));
  const std::vector<reference::Faired> expected = reference::fair(points, settings);
  double size = std::max(settings.closeness_sigma, reference::spacing(points));
  if (settings.closeness_of_radius) size = settings.closeness_sigma * mean_radius(points, settings);
  size *= settings.flat_scale;
  UnmovedCounts counts;
  std::uint64_t short_lists = 0, ill_determined = 0, in_part = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const reference::Faired& e = expected[i];
    counts.non_finite += !reference::is_valid(points[i]);
    if (!reference::is_valid(points[i])) continue;
    short_lists += settings.constraint && e.neighbors < std::size_t(settings.k);
    counts.too_few_neighbors += e.neighbors < 3 && !e.is_outlier;  // in the last iteration, which outliers do not see
    if (e.neighbors >= 3) ill_determined += e.normal.gap < kLeastComparedGap;
    if (e.neighbors >= 3 && e.normal.gap < kLeastComparedGap) continue;
    const double gap = e.neighbors < 3 ? 1 : e.normal.gap;
    const double off = reference::length(reference::to_vec(out[i]) - e.position);
    // the share of a step reads the heights of all neighbours alike, at the rim as well
    const double read = settings.noise > 0 ? 0.003 : 0.001;
    const double at_rim = (e.grows_in_part ? 0.01 : e.reads_part ? read : 0) * settings.similarity_sigma;
    in_part += e.grows_in_part;
    ASSERT_LE(off, allowed(points[i], size, gap) + at_rim)
        << what << ", point " << i << ", gap " << gap << ", spacing " << size;
    const double along = e.neighbors < 3 ? 1 : std::abs(reference::dot(reference::to_vec(normals[i]), e.normal.unit));
    ASSERT_GE(along, 1 - 1e-6 - 1e-10 / std::pow(gap, 4)) << what << ", normal of point " << i;
  }
  const UnmovedCounts found = pipeline.report().unmoved;
  EXPECT_EQ(found.non_finite, counts.non_finite) << what;
  EXPECT_EQ(found.too_few_neighbors, counts.too_few_neighbors) << what;
  EXPECT_LE(found.no_normal, ill_determined) << what;
  EXPECT_EQ(pipeline.report().short_neighborhoods, short_lists) << what;
  EXPECT_LT(ill_determined, points.size() / 4 + 1) << what << ": too few points were compared";
  EXPECT_LT(in_part, points.size() / 2 + 1) << what << ": too few points were compared closely";
}

constexpr double kEqualWeights = 1e9;  // a normal sigma so wide that all neighbours weigh alike

Params one_iteration(double sigma) {
  return {.normal_sigma = sigma,
          .flat_scale = 1,
          .closeness_sigma = sigma,
          .similarity_sigma = 0.7 * sigma,
          .iterations = 1};
}

const Points& hills() {
  static const Points points = shapes::with_noise(shapes::waves(900), 0.006);  // spacing about 0.045
  return points;
}

TEST(Stages, agree_with_the_reference_for_every_k) {
  for (const int k : {1, 2, 3, 5, 8, 16, 32, 64, 512}) {
    Params params = one_iteration(0.012 * std::sqrt(double(k)) + 0.01);
    params.k = k;
    expect_like_reference(hills(), params, "k " + std::to_string(k));
  }
}

TEST(Stages, agree_with_the_reference_for_every_radius_without_a_list) {
  for (const double radius : {0.07, 0.1, 0.3, 2.0}) {
    Params params = one_iteration(radius / 2);
    params.radius = radius;
    expect_like_reference(hills(), params, "radius " + std::to_string(radius));
  }
}

TEST(Stages, agree_with_the_reference_for_k_within_a_radius) {
  for (const int k : {8, 32})
    for (const double radius : {0.06, 0.1, 0.4}) {
      Params params = one_iteration(0.05);
      params.k = k;
      params.radius = radius;
      expect_like_reference(hills(), params, "k " + std::to_string(k) + " radius " + std::to_string(radius));
    }
}

TEST(Stages, agree_with_the_reference_for_the_constrained_neighborhood) {
  const Points sheets = shapes::with_noise(shapes::two_sheets(800, 0.06), 0.002);
  for (const int k : {5, 8, 24, 100})
    for (const double rho : {0.03, 0.055, 0.3}) {
      Params params = one_iteration(0.06);
      params.k = k;
      params.constraint = true;
      params.rho = rho;
      params.delta = 0.004;
      const std::string what = "constraint, k " + std::to_string(k) + " rho " + std::to_string(rho);
      expect_like_reference(sheets, params, what);
      params.radius = 0.15;
      expect_like_reference(sheets, params, what + ", radius");
    }
}

TEST(Stages, agree_with_the_reference_for_every_switch) {
  for (const AreaWeight area : {AreaWeight::none, AreaWeight::length, AreaWeight::squared})
    for (const bool weights : {true, false})
      for (const bool constraint : {true, false})
        for (const int k : {3, 8, 0}) {
          Params params = one_iteration(0.05);
          params.area_weight = area;
          if (!weights) params.normal_sigma = kEqualWeights;
          params.constraint = constraint && k > 3;
          params.rho = 0.06;
          params.delta = 0.01;
          params.k = k == 3 ? 4 : k;
          if (k == 0) params.radius = 0.13;
          expect_like_reference(shapes::with_noise(shapes::uneven(900, 20), 0.004), params,
                                "area " + std::to_string(int(area)) + ", weights " + std::to_string(weights) +
                                    ", constraint " + std::to_string(params.constraint) + ", k " + std::to_string(k));
        }
}

TEST(Stages, agree_with_the_reference_for_radii_that_follow_the_density) {
  const Points points = shapes::with_noise(shapes::uneven(900, 20), 0.004);
  for (const int min_neighbors : {1, 6, 16, 64})
    expect_like_reference(points, {.radius = 0.06, .min_neighbors = min_neighbors, .iterations = 1},
                          "min_neighbors " + std::to_string(min_neighbors));
}

TEST(Stages, agree_with_the_reference_for_neighbourhoods_that_are_thinned) {
  Params params{.flat_scale = 1, .iterations = 1};
  params.radius = 0.5;  // holds hundreds of points, against 4 that the density alone asks for
  params.min_neighbors = 4;
  params.relaxation = 1;
  expect_like_reference(shapes::with_noise(shapes::waves(2500), 0.004), params, "thinned");
}

// From a point far away all others are about as far as the nearest: neighbourhoods that were enlarged would hold them
// all.
TEST(Stages, agree_with_the_reference_where_points_lie_far_away) {
  Points points = shapes::with_noise(shapes::waves(1500), 0.006);
  for (const float far : {3.0f, 40.0f, 900.0f}) points.push_back({far, -2 * far, far / 3});
  expect_like_reference(points, {.flat_scale = 1.5, .iterations = 1}, "points far away");
}

// On a cube the radii of the faces grow and those at its edges do not.
TEST(Stages, agree_with_the_reference_where_radii_grow) {
  const Points points = shapes::with_noise(shapes::cube(1500), 0.004);
  for (const double radius : {0.15, 0.35})  // of a hundred points, and so many that they are thinned
    for (const Offset offset : {Offset::point, Offset::symmetric}) {
      Params params = one_iteration(0.1);
      params.k = kAutomatic;
      params.radius = radius;
      params.min_neighbors = 3;
      params.normal_filter = NormalFilter::on;
      params.crease_angle = 20;
      params.offset = offset;
      params.flat_scale = 1.8;
      expect_like_reference(points, params,
                            "radius " + std::to_string(radius) + ", offset " + std::to_string(int(offset)));
    }
}

TEST(Stages, balls_grow_where_the_surface_is_flat_and_nowhere_else) {
  const Points points = shapes::with_noise(shapes::cube(4000), 0.002);
  Pipeline pipeline = loaded(points);
  Params params = one_iteration(0.06);
  params.k = kAutomatic;
  params.radius = 0.1;
  params.min_neighbors = 1;
  params.normal_filter = NormalFilter::on;
  params.flat_scale = 1;
  Points alike(points.size()), grown(points.size());
  pipeline.run(params, alike);
  params.flat_scale = 1.6;
  pipeline.run(params, grown);
  int moved = 0, on_faces = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    float to_faces[] = {points[i].x, points[i].y, points[i].z};
    for (float& c : to_faces) c = std::min(std::abs(c), std::abs(1 - c));
    std::sort(to_faces, to_faces + 3);
    const bool is_near_edge = to_faces[1] < 0.07f;
    const bool differs = std::memcmp(&alike[i], &grown[i], sizeof(Point)) != 0;
    if (is_near_edge) {
      EXPECT_FALSE(differs) << i;
    } else {
      ++on_faces;
      moved += differs;
    }
  }
  EXPECT_GT(moved, on_faces * 2 / 3);
  params.k = 12;  // lists have no radii
  params.radius = {};
  pipeline.run(params, grown);
  params.flat_scale = 1;
  pipeline.run(params, alike);
  EXPECT_EQ(std::memcmp(alike.data(), grown.data(), sizeof(Point) * points.size()), 0);
}

TEST(Stages, agree_with_the_reference_for_filtered_normals_and_both_offsets) {
  for (const int k : {8, 30, 0})
    for (const bool filter : {true, false})
      for (const Offset offset : {Offset::point, Offset::symmetric})
        for (const bool weights : {true, false}) {
          Params params = one_iteration(0.09);
          params.k = k;
          if (k == 0) params.radius = 0.15;
          if (!weights) params.normal_sigma = kEqualWeights;
          params.normal_filter = filter ? NormalFilter::on : NormalFilter::off;
          params.crease_angle = 35;
          params.offset = offset;
          params.relaxation = 1.5;
          params.area_weight = offset == Offset::symmetric ? AreaWeight::squared : AreaWeight::none;
          expect_like_reference(shapes::with_noise(shapes::cube(900), 0.01), params,
                                "k " + std::to_string(k) + ", filter " + std::to_string(filter) + ", offset " +
                                    std::to_string(int(offset)) + ", weights " + std::to_string(weights));
        }
}

TEST(Stages, agree_with_the_reference_for_the_papers_preset_on_each_shape) {
  for (const Points& points : {hills(), shapes::with_noise(shapes::sphere(900), 0.01),
                               shapes::with_noise(shapes::cube(900), 0.01), shapes::uneven(900, 50)})
    expect_like_reference(points, paper_preset(), "paper");
}

TEST(Stages, agree_with_the_reference_for_automatic_parameters) {
  for (const Points& points :
       {shapes::with_noise(shapes::waves(900), 0.003), shapes::with_noise(shapes::sphere(1200), 0.01)})
    expect_like_reference(points, Params{}, "automatic");
}

TEST(Stages, agree_with_the_reference_after_several_iterations) {
  for (const int iterations : {2, 3, 5}) {
    Params params = one_iteration(0.06);
    params.k = 16;
    params.iterations = iterations;
    expect_like_reference(hills(), params, std::to_string(iterations) + " iterations");
  }
}

TEST(Stages, agree_with_the_reference_where_every_distance_ties) {
  Points points = shapes::grid(7);
  Params params = one_iteration(1.5);
  for (std::size_t i = 0; i < points.size(); ++i) points[i].z *= 1.0f / 8;  // flattened, so that normals exist
  for (const int k : {8, 30}) {
    params.k = k;
    expect_like_reference(points, params, "grid, k " + std::to_string(k));
  }
}

TEST(Stages, agree_with_the_reference_beside_invalid_points) {
  Params params = one_iteration(0.1);
  for (const int k : {8, 0}) {
    params.k = k;
    if (k == 0) params.radius = 0.2;
    expect_like_reference(shapes::with_invalid(hills(), 7), params, "invalid, k " + std::to_string(k));
  }
}

}  // namespace
}  // namespace pointfair
