// SPDX-License-Identifier: Apache-2.0
// Points far from the surface: recognised, kept in place, pulled in or marked; and no point moves farther than allowed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using reference::distance;
using shapes::Points;

constexpr double kSigma = 0.006;

// Two outliers beside each other may pass for a scrap of surface; of 50, so many are recognised at least.
constexpr std::uint64_t kRecognized = 45;

// A noisy plane z = 0 over the unit square; every 100th point is lifted by 10 to 40 sigmas instead.
struct Lifted {
  Points points;
  std::vector<bool> is_lifted;
};

Points noisy_plane() { return shapes::with_noise(shapes::plane(5000), kSigma); }

Lifted with_outliers(Points points) {
  shapes::Random random(7);
  std::vector<bool> is_lifted(points.size());
  for (std::size_t i = 50; i < points.size(); i += 100) {
    points[i].z = float((i % 200 == 50 ? 1 : -1) * kSigma * random.uniform(10, 40));
    is_lifted[i] = true;
  }
  return {std::move(points), std::move(is_lifted)};
}

Params with(Outliers outliers) { return {.outliers = outliers}; }

bool same_bits(Point a, Point b) { return std::memcmp(&a, &b, sizeof a) == 0; }

// Mean height of the points that were not lifted.
double mean_height(const Points& points, const std::vector<bool>& is_lifted) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!is_lifted[i]) sum += std::abs(points[i].z), ++count;
  return sum / count;
}

TEST(Outliers, keep_their_bits_and_are_counted) {
  const Lifted cloud = with_outliers(noisy_plane());
  const Ran outcome(cloud.points, with(Outliers::keep));
  std::uint64_t kept = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i)
    kept += cloud.is_lifted[i] && same_bits(outcome.points[i], cloud.points[i]);
  EXPECT_EQ(outcome.report.unmoved.outliers, kept);
  EXPECT_GE(kept, kRecognized);
  EXPECT_TRUE(outcome.outliers.empty()) << "marks were not asked for";
}

TEST(Outliers, are_kept_without_being_asked_for_within_radii_and_not_in_lists) {
  const Lifted cloud = with_outliers(noisy_plane());
  EXPECT_EQ(Ran(cloud.points, {}).report.params.outliers, Outliers::keep);
  Params lists{.k = 12};
  const Ran outcome(cloud.points, lists);
  EXPECT_EQ(outcome.report.params.outliers, Outliers::off);
  EXPECT_EQ(outcome.report.unmoved.outliers, 0u);
  lists.outliers = Outliers::keep;
  EXPECT_GT(Ran(cloud.points, lists).report.unmoved.outliers, 0u);
}

TEST(Outliers, are_marked_and_no_other_point_is) {
  const Lifted cloud = with_outliers(noisy_plane());
  const Ran outcome(cloud.points, with(Outliers::mark));
  ASSERT_EQ(outcome.outliers.size(), cloud.points.size());
  std::uint64_t marked = 0;
  std::array<std::uint64_t, 4> by_reason{};
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    EXPECT_LE(outcome.outliers[i], cloud.is_lifted[i] ? 3 : 0) << i;
    marked += outcome.outliers[i] != 0;
    ++by_reason[outcome.outliers[i]];
  }
  EXPECT_GE(marked, kRecognized);
  EXPECT_EQ(outcome.report.unmoved.outliers, marked);
  const OutlierCounts& counts = outcome.report.unmoved.outliers_by_reason;
  EXPECT_EQ(counts, (OutlierCounts{by_reason[1], by_reason[2], by_reason[3]}));
  const Ran kept(cloud.points, with(Outliers::keep));
  for (std::size_t i = 0; i < cloud.points.size(); ++i) ASSERT_TRUE(same_bits(kept.points[i], outcome.points[i])) << i;
}

TEST(Outliers, are_marked_in_an_attribute_of_a_free_name) {
  Cloud cloud{.points = with_outliers(noisy_plane()).points};
  Pipeline pipeline = loaded(cloud);
  const Cloud once = pipeline.run(with(Outliers::mark));
  const Attribute marks = attribute(once, "outlier");
  EXPECT_EQ(marks.type, ScalarType::uint8);
  ASSERT_EQ(marks.data.size(), cloud.points.size());
  EXPECT_EQ(marks.data.size() - std::uint64_t(std::count(marks.data.begin(), marks.data.end(), std::byte{0})),
            pipeline.report().unmoved.outliers);
  pipeline.load(once);
  const Cloud twice = pipeline.run(with(Outliers::mark));
  EXPECT_EQ(attribute(twice, "outlier").data, marks.data) << "what the cloud brought stays";
  EXPECT_EQ(attribute(twice, "outlier_2").data.size(), cloud.points.size());
}

TEST(Outliers, are_pulled_in) {
  const Lifted cloud = with_outliers(noisy_plane());
  const Ran outcome(cloud.points, with(Outliers::move));
  EXPECT_EQ(outcome.report.unmoved.outliers, 0u);
  EXPECT_GE(outcome.report.pulled.total(), kRecognized);
  EXPECT_LE(outcome.report.pulled.total(), std::uint64_t(std::ranges::count(cloud.is_lifted, true)));
  std::uint64_t near = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i)
    near += cloud.is_lifted[i] && std::abs(outcome.points[i].z) < 3 * kSigma;
  EXPECT_GE(near, kRecognized);
}

// Strays from 4 to 21 spacings off the plane: other strays are among the nearest points of most of them.
TEST(Outliers, that_have_each_other_for_neighbours_are_pulled_onto_the_surface) {
  int far = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    Points points = noisy_plane();
    shapes::Random random(seed);
    const std::size_t on_plane = points.size();
    for (int i = 0; i < 30; ++i) {
      const double x = random.uniform(0.1, 0.9), y = random.uniform(0.1, 0.9), height = random.uniform(0.06, 0.3);
      points.push_back(shapes::make_point(x, y, i % 2 == 0 ? height : -height));
    }
    const Ran outcome(points, with(Outliers::move));
    for (std::size_t i = on_plane; i < points.size(); ++i) far += std::abs(outcome.points[i].z) > 8 * kSigma;
  }
  EXPECT_LE(far, 15) << "of 180";
}

TEST(Outliers, cost_the_other_points_no_more_than_a_tenth) {
  const Points clean = noisy_plane();
  const Lifted cloud = with_outliers(clean);
  const double without = mean_height(Ran(clean, {}).points, cloud.is_lifted);
  for (const Outliers choice : {Outliers::off, Outliers::keep, Outliers::move, Outliers::mark})
    EXPECT_LT(mean_height(Ran(cloud.points, with(choice)).points, cloud.is_lifted), 1.1 * without);
}

TEST(DisplacementLimit, holds_for_every_point) {
  const Lifted cloud = with_outliers(noisy_plane());
  for (const double limit : {0.5 * kSigma, 2 * kSigma, 10 * kSigma}) {
    Params params{.outliers = Outliers::keep, .displacement_limit = limit};
    const Ran outcome(cloud.points, params);
    std::size_t at_limit = 0;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      const double moved = distance(outcome.points[i], cloud.points[i]);
      ASSERT_LE(moved, limit * (1 + 1e-5) + 1e-7) << i;
      at_limit += moved > 0.98 * limit;
    }
    EXPECT_EQ(at_limit > 0, limit < 3 * kSigma) << limit;
  }
}

// Of noise above half a spacing, and of a seventh; the spacing is 0.014. What edges would move of little noise, its
// share of the step holds back (LowNoise.is_not_raised_at_a_crest).
TEST(DisplacementLimit, is_ten_times_the_noise_by_itself_however_little) {
  const auto in_sigmas = [](double sigma) {
    const Params used = Ran(shapes::with_noise(shapes::plane(5000), sigma), {}).report.params;
    return std::pair(used.displacement_limit.value / sigma, used.outlier_distance.value / sigma);
  };
  const auto [farthest, outlier] = in_sigmas(0.012);
  EXPECT_NEAR(farthest, 10, 1.5);
  EXPECT_NEAR(outlier, 6, 0.9);
  EXPECT_NEAR(in_sigmas(0.002).first, 10, 1.5);
}

TEST(DisplacementLimit, lets_no_noise_stand_out_of_a_plane) {
  constexpr double kNoise = 0.002;  // half a spacing
  double squares = 0, farthest = 0;
  const Points faired = Ran(shapes::with_noise(shapes::plane(60000), kNoise), {}).points;
  for (const Point& p : faired) {
    squares += double(p.z) * p.z;
    farthest = std::max(farthest, std::abs(double(p.z)));
  }
  const double left = std::sqrt(squares / double(faired.size()));
  EXPECT_LT(left, 0.2 * kNoise);
  EXPECT_LT(farthest, 6 * left);
}

TEST(DisplacementLimit, may_be_in_percent_where_nothing_else_asks_for_the_diagonal) {
  Params params = with(Outliers::keep);
  params.radius = params.normal_sigma = params.closeness_sigma = params.similarity_sigma = 0.05;
  params.outlier_distance = 0.1;
  params.displacement_limit = Length(0.1, Length::Unit::percent);
  const double limit = Ran(noisy_plane(), params).report.params.displacement_limit.value;
  EXPECT_NEAR(limit, 0.001 * std::sqrt(2.0), 0.0001);
}

// Terraces of 3 x 3 spacings, every other one up to 4 spacings high, without noise: hardly one of the points is no
// surface.
TEST(Outliers, are_not_the_points_of_a_rough_terrain) {
  constexpr int kCount = 20000;
  const double spacing = 1 / std::sqrt(double(kCount)), cell = 3 * spacing;
  Points points = shapes::plane(kCount);
  for (Point& p : points) {
    shapes::Random random(std::uint64_t(p.x / cell) * 1000 + std::uint64_t(p.y / cell));
    if (random.uniform() < 0.5) p.z = float(4 * spacing * random.uniform());
  }
  EXPECT_LT(Ran(points, {}).report.unmoved.outliers, std::uint64_t(kCount / 100));
}

// Each has others nearer than the plane, so their neighbourhoods hold hardly anything else and are wide.
TEST(Outliers, are_recognised_where_they_are_each_others_neighbours) {
  constexpr double kNoise = 0.007;
  Points points = shapes::with_noise(shapes::plane(20000), kNoise);
  shapes::Random random(11);
  for (std::size_t i = 0; i < points.size(); i += 100)
    points[i].z = float((random.uniform() < 0.5 ? -1 : 1) * random.uniform(10 * kNoise, 0.5));
  const Ran outcome(points, with(Outliers::mark));
  std::size_t recognised = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i % 100 == 0)
      recognised += outcome.outliers[i] != 0;
    else
      EXPECT_FALSE(outcome.outliers[i]) << i;
  }
  EXPECT_GE(recognised, 190u);
  Params any_width{.outliers = Outliers::mark, .outlier_radius = 10};
  EXPECT_LT(Ran(points, any_width).report.unmoved.outliers, 150u);
}

// Points that have a neighbour at the rim of their neighbourhood, grown or not, in the second iteration: the library
// rounds what the first one leaves, so that it may take that neighbour where the reference does not.
std::vector<bool> at_rim_in_second_iteration(const Points& points, reference::Settings s) {
  Points second;
  for (const reference::Faired& faired : reference::fair_once(points, s))
    second.push_back(reference::to_point(faired.position));
  const double growth = s.flat_scale * s.flat_scale;
  std::vector<bool> result(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!reference::is_valid(second[i])) continue;
    const double own = reference::squared_radius(second, i, s);
    for (std::size_t j = 0; j < points.size(); ++j) {
      if (i == j || !reference::is_valid(second[j])) continue;
      const reference::Vec offset = reference::to_vec(second[j]) - reference::to_vec(second[i]);
      for (const double squared : {own, growth * own})
        if (std::abs(reference::dot(offset, offset) - squared) < 1e-6 * squared) result[i] = true;
    }
  }
  return result;
}

TEST(Outliers, agree_with_the_reference) {
  Lifted cloud = with_outliers(shapes::with_noise(shapes::plane(1200), kSigma));
  cloud.points[3].x = std::numeric_limits<float>::quiet_NaN();
  for (const Outliers choice : {Outliers::keep, Outliers::move}) {
    Ran outcome(cloud.points, with(choice));
    const auto settings =
        reference::settings_of(outcome.report.params, PipelineAccess::followed_noise(outcome.pipeline));
    const auto expected = reference::fair(cloud.points, settings);
    const std::vector<bool> at_rim = at_rim_in_second_iteration(cloud.points, settings);
    EXPECT_LE(std::count(at_rim.begin(), at_rim.end(), true), 2);
    std::uint64_t outliers = 0;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      if (i == 3) continue;
      outliers += expected[i].is_outlier;
      if (at_rim[i]) continue;
      EXPECT_LT(reference::length(reference::to_vec(outcome.points[i]) - expected[i].position), 1e-5)
          << i << " of choice " << int(choice);
    }
    EXPECT_EQ(outcome.report.unmoved.outliers, outliers);
    EXPECT_TRUE(std::isnan(outcome.points[3].x));
  }
}

}  // namespace
}  // namespace pointfair
