// SPDX-License-Identifier: Apache-2.0
// The formulas of src/point, for F = float, against closed forms in double.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
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

TEST(NeighborKey, orders_by_distance_and_gives_both_back) {
  const float rising[] = {0.0f, 1e-45f, 1e-38f, 1e-10f, 1.0f, std::nextafter(1.0f, 2.0f), 1e37f};
  const auto nowhere = [](point::Index) -> Vec3<float> { throw std::logic_error("distances differ"); };
  for (std::size_t i = 1; i < std::size(rising); ++i) {
    const auto nearer = point::neighbor_key(rising[i - 1], 0xfffffffeu), farther = point::neighbor_key(rising[i], 0);
    EXPECT_TRUE(point::precedes(nearer, farther, nowhere));
    EXPECT_FALSE(point::precedes(farther, nearer, nowhere));
  }
  EXPECT_EQ(point::key_squared_distance(point::neighbor_key(2.5f, 7)), 2.5f);
  EXPECT_EQ(point::key_index(point::neighbor_key(2.5f, 7)), 7u);
}

TEST(NeighborKey, orders_equal_distances_by_position_and_identical_points_by_index) {
  // by x, then y, then z, as numbers
  const Vec3<float> rising[] = {{-2, 9, 9},    {-1, 9, 9}, {-0.0f, -3, 1}, {0, -2, 9}, {0, 1, -9},
                                {-0.0f, 1, 4}, {0, 1, 4},  {1e-40f, 0, 0}, {3, -9, -9}};
  const auto position_of = [&](point::Index at) { return rising[at]; };
  for (point::Index a = 0; a < std::size(rising); ++a)
    for (point::Index b = 0; b < std::size(rising); ++b) {
      EXPECT_EQ(point::precedes(point::neighbor_key(2, a), point::neighbor_key(2, b), position_of), a < b);
      const bool identical = a == 5 && b == 6;
      EXPECT_EQ(point::lies_before(rising[a], rising[b]), a < b && !identical) << a << ", " << b;
    }
  const auto last = point::neighbor_key(2, point::kNoNeighbor);
  EXPECT_TRUE(point::precedes(point::neighbor_key(2, 8), last, position_of));
  EXPECT_FALSE(point::precedes(last, point::neighbor_key(2, 8), position_of));
  EXPECT_FALSE(point::precedes(last, last, position_of));
}

struct Grown {
  reference::List members;
  bool complete;
};

Grown grow(const shapes::Points& points, const reference::List& candidates, int k, float reach) {
  Grown grown{};
  const auto offset = [&](std::uint32_t j) {
    return Vec3<float>{points[j].x - points[0].x, points[j].y - points[0].y, points[j].z - points[0].z};
  };
  const auto result = point::grow_constrained(
      int(candidates.size()), k, reach, candidates.size() + 1 == points.size(),
      [&](int i) { return offset(candidates[i]); }, [&](int i) { grown.members.push_back(candidates[i]); },
      [&](int i) { return offset(grown.members[i]); });
  grown.complete = result.complete;
  EXPECT_EQ(result.accepted, int(grown.members.size()));
  return grown;
}

TEST(GrowConstrained, agrees_with_the_rule_over_all_points_whenever_it_says_complete) {
  Random random(11);
  int complete_early = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    const shapes::Points points = shapes::with_noise(shapes::two_sheets(120, 0.12, seed), 0.01, seed + 1);
    const int k = 1 + int(random.below(24));
    const float reach = float(random.uniform(0.03, 0.25));
    const reference::List all = reference::nearest(points, 0, points.size());
    const reference::List expected = reference::constrained(points, 0, all, k, reach);
    for (const std::size_t given : {std::size_t(4), std::size_t(k), std::size_t(2 * k + 8), all.size()}) {
      const reference::List candidates(all.begin(), all.begin() + std::ptrdiff_t(std::min(given, all.size())));
      const Grown grown = grow(points, candidates, k, reach);
      if (!grown.complete) continue;
      EXPECT_EQ(grown.members, expected) << "seed " << seed << " k " << k << " reach " << reach;
      complete_early += candidates.size() < all.size();
    }
    EXPECT_TRUE(grow(points, all, k, reach).complete);
  }
  EXPECT_GT(complete_early, 400);
}

TEST(GrowConstrained, does_not_cross_to_a_sheet_farther_than_the_reach_though_it_is_nearer_than_its_own) {
  // the paper's Figure 4: a point's own sheet continues in steps of 0.1, the other sheet is 0.15 away
  shapes::Points points = {{0, 0, 0}};
  for (int i = 1; i <= 4; ++i) points.push_back({0.1f * float(i), 0, 0});
  for (int i = 0; i <= 4; ++i) points.push_back({0.1f * float(i), 0, 0.15f});
  const reference::List all = reference::nearest(points, 0, points.size());
  EXPECT_EQ(grow(points, all, 4, 0.12f).members, (reference::List{1, 2, 3, 4}));
  EXPECT_GE(grow(points, all, 4, 0.2f).members[1], 5u);
}

TEST(BilateralSum, of_no_weight_moves_nothing) {
  point::BilateralSum<float> sum;
  sum.add({1, 0, 0}, {1, 0, 0}, 1.0f, true, point::bilateral_weights(0.01f, 0.01f));
  EXPECT_EQ(sum.distance(), 0.0f);
}

TEST(BilateralSum, does_not_see_the_sign_of_the_normal) {
  Random random(13);
  for (int trial = 0; trial < 1000; ++trial) {
    const Vec3<float> n = random_vector(random), here = random_vector(random);
    point::BilateralSum<float> plus, minus;
    for (int j = 0; j < 8; ++j) {
      const Vec3<float> offset = random_vector(random);
      plus.add(offset, n, 1.0f, true, point::bilateral_weights(1, 1));
      minus.add(offset, -1.0f * n, 1.0f, true, point::bilateral_weights(1, 1));
    }
    const Vec3<float> a = point::moved(here, n, plus.distance());
    const Vec3<float> b = point::moved(here, -1.0f * n, minus.distance());
    EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
  }
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

TEST(Radii, are_enlarged_up_to_the_widest_and_never_cut) {
  const float base = 1, widest = 100;
  const auto radius_of = [&](float reach, float level) {
    return point::squared_radius(reach, reach / 2, level, base, widest);
  };
  EXPECT_EQ(radius_of(10, 4), 41);    // what the level asks for
  EXPECT_EQ(radius_of(40, 4), 101);   // no more than the widest
  EXPECT_EQ(radius_of(400, 4), 401);  // the nearest points lie farther away: these and no others
  EXPECT_EQ(radius_of(400, 0.7f), 0.7f * 400 + 1);
  EXPECT_EQ(radius_of(400, 0.1f), 201);  // the eighth nearest stays inside

  point::MeanTurn<float> flat{0, 10};
  EXPECT_EQ(flat.squared_growth(2.5f, 10, widest), 2.5f);
  EXPECT_EQ(flat.squared_growth(2.5f, 80, widest), 1.25f);
  EXPECT_EQ(flat.squared_growth(2.5f, 400, widest), 1);
}

}  // namespace
}  // namespace pointfair
