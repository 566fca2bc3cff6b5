// SPDX-License-Identifier: Apache-2.0
// Clouds on which a filter has nothing to do, or little to hold on to. Each test's name is the claim.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/pipeline.hpp"
#include "reference.h"
#include "runs.h"
#include "seam/backend.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points, shapes::same_bits;

std::vector<Params> all_kinds() {
  Params list, constrained = paper_preset(), radius, share_of_diagonal, spacings;
  list.k = 16;
  list.area_weight = AreaWeight::squared;
  radius.radius = 0.5;
  share_of_diagonal.radius = Length(5, Length::Unit::percent);
  spacings.k = 20;
  spacings.radius = Length(3, Length::Unit::spacing);
  spacings.closeness_sigma = spacings.normal_sigma = spacings.similarity_sigma = Length(1, Length::Unit::spacing);
  return {Params{}, list, constrained, radius, share_of_diagonal, spacings};
}

std::uint64_t unmoved(const Report& report) {
  return report.unmoved.non_finite + report.unmoved.too_few_neighbors + report.unmoved.no_normal;
}

bool all_finite(const Points& points) {
  for (const Point& p : points)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) return false;
  return true;
}

TEST(Degenerate, no_points_are_no_points_with_every_kind_of_neighborhood) {
  for (const Params& params : all_kinds()) {
    Ran result(Points{}, params);
    EXPECT_EQ(result.report.points, 0u);
    EXPECT_EQ(unmoved(result.report), 0u);
    EXPECT_EQ(result.pipeline.estimates().diagonal, 0);
    EXPECT_EQ(result.pipeline.estimates().spacing, 0);
  }
}

TEST(Degenerate, one_two_and_three_points_keep_their_places_and_are_counted) {
  for (int count = 1; count <= 3; ++count)
    for (const Params& params : all_kinds()) {
      const Points points = shapes::sphere(count);
      Ran result(points, params);
      EXPECT_TRUE(same_bits(result.points, points));
      EXPECT_EQ(result.report.unmoved.too_few_neighbors, std::uint64_t(count));
    }
}

// What they would be leaves every later cloud as it is.
TEST(Degenerate, no_parameters_are_resolved_where_nothing_can_be_measured) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Points& points : {Points{}, Points(300, {nan, 0, 0}), shapes::identical(300), shapes::sphere(3)}) {
    Pipeline pipeline = loaded(points, Device(Device::cpu, 0, 2));
    const std::vector<Params> of_three = {Params{}};  // others need the spacing alone, which three points have
    for (const Params& params : points.size() == 3 ? of_three : all_kinds()) {
      SCOPED_TRACE(points.size());
      expect_error(ErrorKind::usage, "nothing to measure", [&] { pipeline.resolve(params); });
    }
    const Points out = pipeline.run({}).points;
    EXPECT_TRUE(same_bits(out, points));
    const Params given{.k = 8, .normal_sigma = 0.1, .closeness_sigma = 0.1, .similarity_sigma = 0.1, .iterations = 1};
    EXPECT_EQ(pipeline.resolve(given).k, 8);
  }
}

TEST(Degenerate, a_surface_without_noise_is_measured) {
  Pipeline pipeline = loaded(shapes::sphere(3000), Device(Device::cpu, 0, 2));
  EXPECT_GT(pipeline.resolve({}).radius.value, 0);
}

TEST(Degenerate, lengths_in_percent_or_spacings_of_nothing_are_reported_as_lengths_that_can_be_given_again) {
  for (const ParamInfo& info : kParams) {
    const auto* const field = std::get_if<Length Params::*>(&info.field);
    if (!field) continue;
    for (const Length length : {Length(1, Length::Unit::percent), Length(2, Length::Unit::spacing)}) {
      Params params;
      params.*(*field) = length;
      const Params used = Ran(shapes::identical(300), params).report.params;
      EXPECT_GT((used.*(*field)).value, 0) << info.name;
      EXPECT_NO_THROW(check_params(used)) << info.name;
    }
  }
}

TEST(Degenerate, k_points_and_one_more_are_faired_with_all_there_are) {
  for (const int count : {4, 15, 16, 17})
    for (const int k : {16, 512}) {
      Ran result(shapes::with_noise(shapes::sphere(count), 0.05), {.k = k});
      EXPECT_TRUE(all_finite(result.points));
      EXPECT_EQ(result.report.unmoved.too_few_neighbors, 0u);
    }
}

TEST(Degenerate, identical_points_and_points_on_a_line_keep_their_places_and_are_counted) {
  for (const Points& points : {shapes::identical(3000), shapes::line(3000)})
    for (const Params& params : all_kinds()) {
      Ran result(points, params);
      EXPECT_TRUE(same_bits(result.points, points));
      EXPECT_EQ(unmoved(result.report), points.size());
    }
}

// As where a sensor writes the origin for what it did not see: the others are treated as if these were not there.
TEST(Degenerate, a_crowd_at_one_place_stays_and_is_counted_and_the_others_are_treated) {
  const Points surface = shapes::with_noise(shapes::waves(6000), 0.01);
  for (const int crowd : {400, 401, 3000}) {
    Points points = surface;
    const Point place = {3, 3, 3};
    for (int i = 0; i < crowd; ++i) points.insert(points.begin() + std::ptrdiff_t(i * 2), place);
    for (const Params& params : all_kinds()) {
      Ran result(points, params);
      std::uint64_t moved = 0;
      for (std::size_t i = 0; i < points.size(); ++i) {
        ASSERT_TRUE(std::isfinite(result.points[i].x));
        if (points[i].x == place.x) {
          ASSERT_EQ(std::memcmp(&result.points[i], &points[i], sizeof(Point)), 0);
        } else {
          moved += std::memcmp(&result.points[i], &points[i], sizeof(Point)) != 0;
        }
      }
      EXPECT_GE(unmoved(result.report), std::uint64_t(crowd));
      EXPECT_GT(moved, surface.size() * 9 / 10);
    }
  }
}

TEST(Degenerate, doubled_points_move_alike) {
  Points points = shapes::with_noise(shapes::waves(1000), 0.004);
  points.insert(points.end(), points.begin(), points.end());
  const Points out = Ran(points, {.radius = 0.1}).points;
  for (std::size_t i = 0; i < 1000; ++i)
    ASSERT_LT(reference::length(reference::to_vec(out[i]) - reference::to_vec(out[i + 1000])), 1e-5);
}

TEST(Degenerate, nan_infinite_and_overflowing_points_keep_their_bits_and_are_counted) {
  const Points points = shapes::with_invalid(shapes::with_noise(shapes::waves(3000), 0.004), 6);
  for (const Params& params : all_kinds()) {
    Ran result(points, params);
    EXPECT_EQ(result.report.unmoved.non_finite, 500u);
    EXPECT_EQ(result.pipeline.estimates().points, 3000u);
    EXPECT_EQ(result.pipeline.estimates().finite, 2500u);
    for (std::size_t i = 0; i < points.size(); ++i)
      if (!reference::is_valid(points[i]))
        ASSERT_EQ(std::memcmp(&result.points[i], &points[i], sizeof(Point)), 0);
      else
        ASSERT_TRUE(std::isfinite(result.points[i].x + result.points[i].y + result.points[i].z));
  }
}

// One round of a filter of normals swaps their memory, which has room for the valid points alone, with the upload's.
TEST(Degenerate, an_index_is_built_anew_of_a_cloud_of_mostly_invalid_points) {
  Points points = shapes::waves(4000);
  points.resize(400'000, Point{std::numeric_limits<float>::quiet_NaN(), 0, 0});
  NeighborSettings nearest;
  nearest.k = 8;
  NormalSettings filtered;
  filtered.sigma = 0.1f;
  filtered.filter_rounds = 1;
  const std::unique_ptr<Backend> backend = make_cpu_backend(2);
  backend->upload(points, IndexOrder::fastest);
  for (int times = 0; times < 2; ++times) {
    backend->build_index(0, std::nullopt, {});
    backend->find_neighbors(0, nearest, {});
    backend->estimate_normals(0, filtered, {});
  }
  Points held(points.size());
  backend->download_input(held);
  EXPECT_TRUE(same_bits(held, points));
}

TEST(Degenerate, invalid_points_do_not_change_the_others) {
  const Points points = shapes::with_noise(shapes::waves(2000), 0.004);
  Points mixed = points;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (int i = 0; i < 500; ++i) mixed.push_back({nan, 0, 0});
  Params params{.k = 16, .normal_sigma = 0.05, .closeness_sigma = 0.05, .similarity_sigma = 0.05};
  Points out = Ran(mixed, params).points;
  out.resize(points.size());
  EXPECT_TRUE(same_bits(out, Ran(points, params).points));
}

TEST(Degenerate, a_stray_point_stays_and_does_not_change_the_others) {
  const Points points = shapes::with_noise(shapes::waves(3000), 0.004);
  Params params{.k = 16, .normal_sigma = 0.05, .closeness_sigma = 0.05, .similarity_sigma = 0.05};
  const Points expected = Ran(points, params).points;
  for (const float distance : {1e3f, 1e6f, 1e12f, 9e17f}) {
    Points out = Ran(shapes::with_stray(points, distance), params).points;
    EXPECT_EQ(out.back().x, distance);
    EXPECT_EQ(out.back().y, distance);
    EXPECT_EQ(out.back().z, distance);
    out.pop_back();
    EXPECT_TRUE(same_bits(out, expected)) << distance;
  }
}

TEST(Degenerate, coordinates_from_tiny_to_1e17_stay_finite) {
  for (const float factor : {1e-30f, 1e-20f, 1e-15f, 1e-6f, 1e6f, 1e15f, 9e17f})
    for (Params params : {Params{}, paper_preset()}) {
      const Points points = shapes::scaled(shapes::with_noise(shapes::sphere(1000), 0.01), factor * 0.9f);
      EXPECT_TRUE(all_finite(Ran(points, params).points)) << factor;
    }
}

TEST(Degenerate, offsets_as_large_as_float_coordinates_of_utm_do_not_spoil_the_normals) {
  // 5e6 leaves steps of 0.5: what a float file of such coordinates holds is a lattice, whose plane is still level
  const Points points = shapes::shifted(shapes::scaled(shapes::plane(3000), 100), {448000, 5411000, 300});
  Ran result(points);
  for (std::size_t i = 0; i < points.size(); ++i) ASSERT_EQ(result.points[i].z, points[i].z);
}

TEST(Degenerate, widths_far_below_the_spacing_leave_every_point_in_place) {
  const Points points = shapes::with_noise(shapes::waves(1000), 0.004);
  for (const double sigma : {1e-6, 1e-20, 1e-38}) {
    Params params{.k = 12, .closeness_sigma = sigma};
    EXPECT_TRUE(same_bits(Ran(points, params).points, points)) << sigma;
    params.normal_sigma = params.similarity_sigma = sigma;
    EXPECT_TRUE(same_bits(Ran(points, params).points, points)) << sigma;
  }
}

TEST(Degenerate, widths_far_above_the_cloud_stay_finite) {
  const Points points = shapes::with_noise(shapes::waves(1000), 0.004);
  for (const double sigma : {1e6, 1e20, 1e30}) {
    Params params{.k = 12, .normal_sigma = sigma, .closeness_sigma = sigma, .similarity_sigma = sigma};
    EXPECT_TRUE(all_finite(Ran(points, params).points)) << sigma;
    params.radius = sigma;
    EXPECT_TRUE(all_finite(Ran(points, params).points)) << sigma;
  }
}

TEST(Degenerate, points_with_fewer_than_three_neighbors_keep_their_places_and_are_counted) {
  const Points points = shapes::waves(1000);
  const Params kinds[] = {{.k = 1},
                          {.k = 2},
                          {.radius = 1e-4, .min_neighbors = 1, .flat_scale = 1},
                          {.radius = 1e-25, .min_neighbors = 1, .flat_scale = 1},
                          {.k = 8, .constraint = true, .rho = 1e-5, .delta = 1e-5}};
  for (const Params& params : kinds) {
    const Ran result(points, params);
    EXPECT_TRUE(same_bits(result.points, points));
    EXPECT_EQ(result.report.unmoved.too_few_neighbors, points.size());
    EXPECT_EQ(result.report.short_neighborhoods, params.constraint ? points.size() : 0);
  }
}

TEST(Degenerate, a_run_before_any_load_returns_no_points) {
  Pipeline pipeline(Device::cpu);
  EXPECT_TRUE(pipeline.run().points.empty());
}

// Of a cloud that is not there: its size is refused before a point is read.
TEST(Degenerate, more_points_than_a_pipeline_holds_are_refused_with_the_limit) {
  for (const DeviceStatus& device : list_devices()) {
    if (!device.usable) continue;
    Pipeline pipeline = loaded(shapes::sphere(100), device.info.kind);
    Point point{};
    const std::span<const Point> too_many(&point, kMaxPoints + 1);
    const test::Thrown thrown = test::thrown_by([&] { pipeline.load(too_many); });
    EXPECT_EQ(thrown.kind, ErrorKind::usage);
    for (const std::size_t count : {kMaxPoints, kMaxPoints + 1})
      EXPECT_NE(thrown.message.find(std::to_string(count)), std::string::npos) << thrown.message;
    EXPECT_TRUE(pipeline.run().points.empty()) << "the cloud before is gone, as after any load that fails";
  }
}

TEST(Degenerate, an_output_of_another_size_is_refused_with_both_counts) {
  Pipeline pipeline = loaded(shapes::sphere(100));
  Points out(99);
  expect_error(ErrorKind::usage, "99", [&] { pipeline.run({}, out); });
  expect_error(ErrorKind::usage, "100", [&] { pipeline.run({}, out); });
}

}  // namespace
}  // namespace pointfair
