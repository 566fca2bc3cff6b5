// SPDX-License-Identifier: Apache-2.0
// The formulas of src/point, for F = float, against closed forms in double.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "point/fairing.h"
#include "point/neighborhoods.h"
#include "point/neighbors.h"
#include "point/normal.h"
#include "point/rough_sample.h"
#include "reference.h"
#include "shapes.h"

namespace pointfair {
namespace {

using point::Sym3;
using point::Vec3;
using shapes::Random;

Vec3<float> random_vector(Random& random, double scale = 1) {
  const float x = float(scale * random.normal()), y = float(scale * random.normal());
  return {x, y, float(scale * random.normal())};
}

TEST(Gaussian, is_exp_but_for_2e_7_and_the_rounding_of_every_exponent) {
  double worst = 0;
  for (float t = 0; t < 86.999f; t = std::nextafter(t + 2e-5f, 100.0f)) {
    const double exact = std::exp(-double(t));
    worst = std::max(worst, std::abs(double(point::gaussian(t)) - exact) / exact / (1 + double(t)));
  }
  for (float t = 1e-30f; t < 1e-3f; t *= 1.001f)
    worst = std::max(worst, std::abs(double(point::gaussian(t)) / std::exp(-double(t)) - 1));
  EXPECT_LT(worst, 2e-7);
}

TEST(Gaussian, is_one_at_zero_and_zero_far_out_and_for_nan) {
  EXPECT_EQ(point::gaussian(0.0f), 1.0f);
  EXPECT_EQ(point::gaussian(87.0f), 0.0f);
  EXPECT_EQ(point::gaussian(std::numeric_limits<float>::infinity()), 0.0f);
  EXPECT_EQ(point::gaussian(std::numeric_limits<float>::quiet_NaN()), 0.0f);
}

TEST(CompactGaussian, is_within_three_percent_of_exp_up_to_two_and_zero_far_out_and_for_nan) {
  using point::CompactGaussian;
  const auto of = [](float t) { return CompactGaussian::of(t * CompactGaussian::kScale); };
  for (float t = 0; t < 15.9f; t += 1e-3f) {
    const double base = 1 - double(t) / 17, exact = std::pow(base, 16);
    ASSERT_NEAR(of(t), exact, exact * (1e-6 + 2e-6 / base)) << t;
    if (t < 2) {
      ASSERT_NEAR(exact / std::exp(-double(t)), 1, 0.031) << t;
    }
  }
  EXPECT_EQ(of(0.0f), 1.0f);
  EXPECT_FLOAT_EQ(CompactGaussian::kRootScale * CompactGaussian::kRootScale, CompactGaussian::kScale);
  for (const float t : {16.0f, 1e30f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()})
    EXPECT_EQ(of(t), 0.0f) << t;
}

Eigen::Matrix3d to_eigen(const Sym3<float>& m) {
  return Eigen::Matrix3d{{m.xx, m.xy, m.xz}, {m.xy, m.yy, m.yz}, {m.xz, m.yz, m.zz}};
}

// The covariance of points spread by three given deviations along random axes.
Sym3<float> covariance(Random& random, double a, double b, double c) {
  Eigen::Matrix3d q;
  for (int i = 0; i < 9; ++i) q(i / 3, i % 3) = random.normal();
  q = Eigen::HouseholderQR<Eigen::Matrix3d>(q).householderQ();
  const Eigen::Matrix3d m = q * Eigen::Vector3d(a * a, b * b, c * c).asDiagonal() * q.transpose();
  return {float(m(0, 0)), float(m(0, 1)), float(m(0, 2)), float(m(1, 1)), float(m(1, 2)), float(m(2, 2))};
}

// Rounding moves the root by about 1e-7 of the trace over the gap to the next one, and so turns the eigenvector by that
// over the gap again.
TEST(LeastEigenvector, agrees_with_eigen_to_rounding_over_the_squared_gap) {
  Random random(3);
  for (int i = 0; i < 200000; ++i) {
    const double scale = std::ldexp(1, int(random.below(60)) - 30);
    const double thin = std::ldexp(random.uniform(), -int(random.below(12)));
    const Sym3<float> m = covariance(random, scale, scale * random.uniform(0.05, 1), scale * thin);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(to_eigen(m));
    const double gap = (solver.eigenvalues()[1] - solver.eigenvalues()[0]) / solver.eigenvalues().sum();
    if (gap < 0.002) continue;  // closer than that, neighbours in a line
    const point::Direction<float> found = point::least_eigenvector(m);
    ASSERT_TRUE(found.exists) << "gap " << gap;
    const Eigen::Vector3d n(found.unit.x, found.unit.y, found.unit.z);
    ASSERT_NEAR(n.norm(), 1, 1e-6);
    const double sine = n.cross(solver.eigenvectors().col(0)).norm();
    ASSERT_LT(sine, 4e-7 + 1e-6 / (gap * gap)) << "gap " << gap << " scale " << scale;
  }
}

TEST(LeastEigenvector, is_exact_for_points_in_a_coordinate_plane) {
  const point::Direction<float> found = point::least_eigenvector(Sym3<float>{3, 1, 0, 2, 0, 0});
  ASSERT_TRUE(found.exists);
  EXPECT_EQ(std::abs(found.unit.z), 1.0f);
  EXPECT_EQ(found.unit.x, 0.0f);
  EXPECT_EQ(found.unit.y, 0.0f);
}

TEST(LeastEigenvector, does_not_exist_for_points_on_a_line_or_all_identical_or_not_finite) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Sym3<float>& m : {Sym3<float>{1, 2, 3, 4, 6, 9}, Sym3<float>{5, 0, 0, 0, 0, 0}, Sym3<float>{},
                               Sym3<float>{nan, 0, 0, 1, 0, 1}, Sym3<float>{1e38f, 0, 0, 1e38f, 0, 1e30f}}) {
    const point::Direction<float> found = point::least_eigenvector(m);
    EXPECT_FALSE(found.exists);
    EXPECT_EQ(point::squared_length(found.unit), 0.0f);
  }
}

TEST(SquaredGap, of_boxes_is_never_above_the_distance_of_points_inside) {
  Random random(5);
  for (int i = 0; i < 300000; ++i) {
    const double size = std::ldexp(1, int(random.below(20)) - 10), apart = std::ldexp(1, int(random.below(20)) - 10);
    const Vec3<float> shift = random_vector(random, apart);
    Vec3<float> a[2], b[2];
    for (auto& p : a) p = random_vector(random, size);
    for (auto& p : b) p = random_vector(random, size) + shift;
    const auto low = [](const Vec3<float>* p) {
      return Vec3<float>{std::min(p[0].x, p[1].x), std::min(p[0].y, p[1].y), std::min(p[0].z, p[1].z)};
    };
    const auto high = [](const Vec3<float>* p) {
      return Vec3<float>{std::max(p[0].x, p[1].x), std::max(p[0].y, p[1].y), std::max(p[0].z, p[1].z)};
    };
    const float gap = point::squared_gap(low(a), high(a), low(b), high(b));
    for (const auto& p : a)
      for (const auto& q : b) ASSERT_LE(gap, point::squared_length(q - p));
  }
}

reference::List grow(const shapes::Points& points, const reference::List& candidates, int k, float reach) {
  reference::List members;
  const auto offset = [&](std::uint32_t j) {
    return Vec3<float>{points[j].x - points[0].x, points[j].y - points[0].y, points[j].z - points[0].z};
  };
  point::grow_constrained(
      int(candidates.size()), k, reach, candidates.size() + 1 == points.size(),
      [&](int i) { return offset(candidates[i]); }, [&](int i) { members.push_back(candidates[i]); },
      [&](int i) { return offset(members[i]); });
  return members;
}

TEST(GrowConstrained, does_not_cross_to_a_sheet_farther_than_the_reach_though_it_is_nearer_than_its_own) {
  // the paper's Figure 4: a point's own sheet continues in steps of 0.1, the other sheet is 0.15 away
  shapes::Points points = {{0, 0, 0}};
  for (int i = 1; i <= 4; ++i) points.push_back({0.1f * float(i), 0, 0});
  for (int i = 0; i <= 4; ++i) points.push_back({0.1f * float(i), 0, 0.15f});
  const reference::List all = reference::nearest(points, 0, points.size());
  EXPECT_EQ(grow(points, all, 4, 0.12f), (reference::List{1, 2, 3, 4}));
  EXPECT_GE(grow(points, all, 4, 0.2f)[1], 5u);
}

// Of what repeats along an array the sample sees about its share, also where every stretch holds whole periods.
TEST(RoughSample, sees_every_phase_of_what_repeats) {
  constexpr int kSample = 256;
  for (const std::size_t period : {2, 3, 5, 16, 64, 640})
    for (const std::size_t periods : {1, 2, 7, 78, 1000}) {
      const std::size_t length = period * periods;
      std::vector<int> of_phase(period);
      for (unsigned i = 0; i < kSample; ++i) {
        const std::size_t place = point::place_in_stretch(i, length);
        ASSERT_EQ(place / length, i);
        ++of_phase[place % period];
      }
      const double share = 1.0 / double(period), most = kSample * share + 5 * std::sqrt(kSample * share) + 1;
      for (const int count : of_phase) EXPECT_LT(count, most) << period << " times " << periods;
    }
}

TEST(IsCrowded, counts_the_run_of_points_at_one_place_as_brute_force_does) {
  constexpr int kMost = int(point::kNeighborhoodPoints);
  Random random(5);
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<int> place;
    for (int run = 0; run < 6; ++run) {
      const int around = kMost + int(random.uniform(-3, 4)), length = run % 2 == 0 ? around : int(random.uniform(1, 9));
      place.insert(place.end(), std::size_t(length), run);
    }
    const auto count = point::Index(place.size()), begin = point::Index(random.uniform(0, 300));
    for (point::Index at = begin; at < count; at += 1 + at % 7) {
      const auto same = std::count(place.begin() + begin, place.end(), place[at]);
      EXPECT_EQ(point::is_crowded(at, begin, count, [&](point::Index i) { return place.at(i) == place[at]; }),
                same > kMost);
    }
  }
}

// A knot of points far narrower than the noise of the cloud around it: R^2 rounds to what the noise makes of it, but
// the share must still be small.
TEST(KeptShare, is_small_where_points_are_far_nearer_than_the_radius) {
  const point::Radii radii{nullptr, 1e-6f, 16};
  for (const float reach : {1e-20f, 1e-16f, 1e-14f, 1e-12f}) {
    const float own = point::squared_radius(reach, reach / 2, 1.0f, radii.squared_base, INFINITY);
    EXPECT_LE(point::kept_share(radii, 1.0f, own, own), 1.0f / 1000) << reach;
  }
  const float own = point::squared_radius(0.0f, 0.0f, 1.0f, radii.squared_base, INFINITY);  // nothing is known
  EXPECT_GE(point::kept_share(radii, 1.0f, own, own), 1.0f);
}

}  // namespace
}  // namespace pointfair
