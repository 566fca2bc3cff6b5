// SPDX-License-Identifier: Apache-2.0
// What the nearest points of a sample show of the noise: how far they lie off a cubic over their plane (Eq. 8 of
// docs/how-it-works.md). A team of lanes shares the work on one sample: on a card a warp, on the CPU one thread that
// takes the lanes' work in vectors. A Team offers
//   for_each(count, body)     body(i) for each i below count, once, by some lane; then all see what was written
//   Sums<N>                   N sums over places: add(first, end, terms) adds Terms<N> terms(i) of each of them, place
//                             i to partial sum i % kStrides; total() adds these up, halves onto halves
// so sums have one order whoever makes them. All lanes call all functions, and all get the results.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

using Offset = Vec3<double>;  // of a neighbour from its sample
POINTFAIR_INLINE double length(Offset o) { return square_root(squared_length(o)); }

inline constexpr int kStrides = 32;
template <int N>
struct Terms {
  double of[N];
};

template <int I>
struct Constant {
  static constexpr int value = I;
};
// Calls body(Constant<i>) for each i below N: unrolled, so that what it indexes can stay in registers.
template <int N, class Body>
POINTFAIR_INLINE void for_constants(const Body& body) {
  if constexpr (N > 0) {
    for_constants<N - 1>(body);
    body(Constant<N - 1>{});
  }
}

// A cubic over the plane: terms u^p v^q, p + q <= 3, by degree p + q and then by q. Its normal equations hold products
// of two terms, of degree 6 at most, in the same order.
inline constexpr int kCubicTerms = 10, kProducts = 28;
struct Powers {
  int u, v;
};
POINTFAIR_INLINE constexpr Powers powers_of(int term) {
  int degree = 0;
  while ((degree + 1) * (degree + 2) / 2 <= term) ++degree;
  const int v = term - degree * (degree + 1) / 2;
  return {degree - v, v};
}
POINTFAIR_INLINE constexpr int term_of(Powers p) { return (p.u + p.v) * (p.u + p.v + 1) / 2 + p.v; }

// Where a team keeps up to kMost neighbours of its sample and what it makes of them.
template <int kMost>
struct FitSpace {
  double x[kMost], y[kMost], z[kMost];       // offsets, nearest first
  double own[kMost];                         // 1 on the sample's own sheet, 0 on the other one
  double u[kMost], v[kMost], height[kMost];  // over the plane; 0 where not own
  double sums[kProducts + kCubicTerms];
  double equations[kCubicTerms][kCubicTerms + 1];

  POINTFAIR_INLINE Offset offset(int i) const { return {x[i], y[i], z[i]}; }
};

// First and second moments of offsets from the sample. It lies among them, so little is lost when the mean is taken off
// at the end, and a neighbourhood that grows adds its new points only.
inline constexpr int kMoments = 9;
POINTFAIR_INLINE Terms<kMoments> moments(Offset o, double weight) {
  const Offset w = weight * o;
  return {{w.x, w.y, w.z, w.x * o.x, w.x * o.y, w.x * o.z, w.y * o.y, w.y * o.z, w.z * o.z}};
}

struct Plane {
  Offset centroid, normal;
  double variance;   // along the normal
  double across;     // the lesser variance along the plane
  double roundness;  // that over the greater one: 0 on a line
  bool exists;
  POINTFAIR_INLINE double height(Offset o) const { return dot(o - centroid, normal); }
};

// Of n offsets, from their moments, as the next two.
POINTFAIR_INLINE Offset centroid_of(const Terms<kMoments>& sums, double n) {
  return {sums.of[0] / n, sums.of[1] / n, sums.of[2] / n};
}
POINTFAIR_INLINE Sym3<double> covariance_of(const Terms<kMoments>& sums, double n, Offset c) {
  const double(&s)[kMoments] = sums.of;
  return {s[3] / n - c.x * c.x, s[4] / n - c.x * c.y, s[5] / n - c.x * c.z,
          s[6] / n - c.y * c.y, s[7] / n - c.y * c.z, s[8] / n - c.z * c.z};
}
POINTFAIR_INLINE Plane plane_of(const Terms<kMoments>& sums, double n) {
  const Offset c = centroid_of(sums, n);
  const Sym3<double> m = covariance_of(sums, n, c);
  const auto normal = least_eigenvector(m);
  const Offset a = normal.unit;
  const Offset along = {(m.xx * a.x + m.xy * a.y) + m.xz * a.z, (m.xy * a.x + m.yy * a.y) + m.yz * a.z,
                        (m.xz * a.x + m.yz * a.y) + m.zz * a.z};
  const double least = larger(0.0, dot(along, a));
  // the other two variances, from their sum and their product
  const double both = ((m.xx + m.yy) + m.zz) - least;
  const double minors = ((m.xx * m.yy - m.xy * m.xy) + (m.xx * m.zz - m.xz * m.xz)) + (m.yy * m.zz - m.yz * m.yz);
  const double product = minors - least * both;
  const double greater = (both + square_root(larger(0.0, both * both - 4 * product))) / 2;
  const double across = both - greater;
  return {c, a, least, across, greater > 0 ? across / greater : 0, normal.exists};
}

// A sphere of radius r cuts the slab of noise: near its rim only small offsets are inside. Undoes that to second order.
POINTFAIR_INLINE double without_slab_bias(double variance, double radius) {
  const double scale = 1 / (radius * radius);
  double s2 = variance;
  for (int round = 0; round < 8; ++round) {
    const double t = smaller(0.15, s2 * scale);
    s2 = variance * (1 - t) / (1 - 3 * t);
  }
  return s2;
}

inline constexpr double kWideRadius = 3.7;  // standard deviations of the heights over a plane
inline constexpr double kWideAcross = 2;    // variances of these, of the lesser one along the plane; 1.2 about a line
inline constexpr double kHollow = 1.4;      // of squared mean squares; 1 on a tube, 2 in a wire's noise

// The nearest points of a sample, first few of them and then more.
template <class Team, int kMost>
class GrowingNeighborhood {
 public:
  // Of the offsets in `space`, which it goes on using. `sheets`: the cloud has thin parts, so two groups of heights are
  // two sheets also where one group of noise would now and then look like them.
  POINTFAIR_INLINE GrowingNeighborhood(Team team, FitSpace<kMost>& space, bool sheets)
      : team_(team), space_(space), sheets_(sheets) {}

  // Looks at the first n, 4 <= n <= kMost and never fewer than before. O(n).
  POINTFAIR_INLINE void grow_to(int n) {
    const FitSpace<kMost>& space = space_;
    moments_.add(count_, n, [&space](int i) { return moments(space.offset(i), 1); });
    count_ = n;
    radius_ = length(space.offset(n - 1));
    is_surface_ = radius_ < kSurfaceGrowth * length(space.offset(n / 4 - 1));
    plane_ = plane_of(moments_.total(), n);
    find_own_sheet();
    if (gap_ == 0 || !has_enough()) return;
    typename Team::template Sums<kMoments> of_own(team_);
    of_own.add(0, n, [&space](int i) { return moments(space.offset(i), space.own[i]); });
    plane_ = plane_of(of_own.total(), own_count_);
  }

  // Whether there are enough points of the sample's own sheet, and neither along a line nor in one place: residuals of
  // a cubic over such points are no noise.
  POINTFAIR_INLINE bool shows_a_surface() const { return is_surface_ && plane_.exists && has_enough(); }
  // Whether the neighbourhood is wide against the noise.
  POINTFAIR_INLINE bool is_wide() const {
    return shows_a_surface() && radius_ >= kWideRadius * square_root(plane_variance());
  }
  // Whether one that is wide is so along a single line, about which it is as thick in each direction, and hollow:
  // heights over a plane through a tube of few points are shape, and show no noise. Noise about a wire is hollow
  // nowhere: of its distances from the line, the mean fourth power is twice the squared mean square; of a tube's as
  // large. O(n).
  POINTFAIR_INLINE bool is_tube() const {
    if (gap_ > 0 || plane_.across >= kWideAcross * plane_variance()) return false;
    const Terms<kMoments> sums = moments_.total();
    const double n = count_;
    const Offset c = centroid_of(sums, n);
    const Sym3<double> m = covariance_of(sums, n, c);
    const double trace = (m.xx + m.yy) + m.zz;
    const auto line = least_eigenvector(Sym3<double>{trace - m.xx, -m.xy, -m.xz, trace - m.yy, -m.yz, trace - m.zz});
    if (!line.exists) return false;
    const FitSpace<kMost>& space = space_;
    const Offset along = line.unit;
    typename Team::template Sums<2> powers(team_);
    powers.add(0, count_, [&space, c, along](int i) {
      const double squared = squared_length(cross(space.offset(i) - c, along));
      return Terms<2>{{squared, squared * squared}};
    });
    const Terms<2> found = powers.total();
    return found.of[1] * n < kHollow * found.of[0] * found.of[0];
  }
  // The gap between the two sheets of a thin part that these points belong to; 0 where there is one sheet.
  POINTFAIR_INLINE double gap() const { return gap_; }
  // Whether there may be two sheets: in a thin part most neighbourhoods say so, of one sheet's few. To be asked before
  // noise(). O(n).
  POINTFAIR_INLINE bool may_be_sheets() { return gap_ > 0 || are_sheets(true); }
  // Side of the square that holds one point of the sheet.
  POINTFAIR_INLINE double spacing() const { return radius_ * square_root(3.141592653589793 / own_count_); }
  // Standard deviation of the own sheet's heights over their least-squares cubic, unbiased: n - 10 for n. Only of what
  // shows a surface. O(n), 60 n products.
  POINTFAIR_INLINE double noise() {
    place_over_plane();
    fit_cubic();
    const FitSpace<kMost>& space = space_;
    const Terms<kCubicTerms> cubic = fitted_cubic();
    typename Team::template Sums<1> squares(team_);
    squares.add(0, count_, [&space, cubic](int i) {
      const double residual = over_cubic(space, cubic, i);
      return Terms<1>{{residual * residual}};
    });
    residuals_ = squares.total().of[0] / (own_count_ - kCubicTerms);
    return square_root(cut_off_by_groups() * without_slab_bias(residuals_, radius_));
  }
  // The share of the residuals that noise() saw that are beyond two standard deviations. O(n).
  POINTFAIR_INLINE double beyond_two() const {
    const FitSpace<kMost>& space = space_;
    const Terms<kCubicTerms> cubic = fitted_cubic();
    const double most = 4 * residuals_;
    typename Team::template Sums<1> beyond(team_);
    beyond.add(0, count_, [&space, cubic, most](int i) {
      const double residual = over_cubic(space, cubic, i);
      return Terms<1>{{residual * residual > most ? 1.0 : 0.0}};
    });
    return beyond.total().of[0] / own_count_;
  }

 private:
  // The variance of the own sheet's heights over their plane, unbiased: n - 3 for n.
  POINTFAIR_INLINE double plane_variance() const {
    const double n = own_count_;
    return plane_.variance * n / (n - 3);
  }
  static constexpr int kFewest = 15;  // points of a sheet
  // Of the radius from a quarter of the points to all of them: 2 on a plane, 4 on a line.
  static constexpr double kSurfaceGrowth = 2.6;
  static constexpr int kGroupingRounds = 5;
  static constexpr double kSheetVariance = 0.12;  // of all variance, left within two groups of heights: two sheets
  // Of two groups that lie over each other and keep more: the most of the variance within them, and the least gap
  // between them, in spacings of one of two equal sheets; anywhere, and in clouds of thin parts.
  static constexpr double kMixedVariance = 0.2, kLeastGap = 0.5;
  static constexpr double kMixedVarianceOfThin = 0.3, kLeastGapOfThin = 0.35;
  static constexpr int kAsked = 64;           // points, of which it is asked what lies beside them
  static constexpr double kVanishing = 1e-9;  // pivots, of the number of points

  POINTFAIR_INLINE bool has_enough() const { return own_count_ >= kFewest; }

  // The points on the sample's side where heights over the plane lie in two groups with a gap between, as those of two
  // sheets of a thin part do; all of them elsewhere. Groups by two-means: of Gaussian heights its groups keep 0.36 of
  // the variance, of two sheets 6 sigmas apart 0.1, of 4 sigmas 0.19. Waves of a shape keep so little, too, but lie
  // beside each other. Sweeps of a scanner that are off from each other are one surface, and nearer.
  POINTFAIR_INLINE void find_own_sheet() {
    const Plane plane = plane_;
    FitSpace<kMost>& space = space_;
    gap_ = 0;
    own_count_ = count_;
    team_.for_each(count_, [&space, plane](int i) {
      space.height[i] = plane.height(space.offset(i));
      space.own[i] = 1;
    });
    groups_ = groups();
    if (!are_sheets(sheets_)) return;
    gap_ = groups_.gap;
    const double threshold = groups_.threshold;
    const bool is_above = plane.height({0, 0, 0}) >= threshold;
    team_.for_each(count_, [&space, threshold, is_above](int i) {
      space.own[i] = (space.height[i] >= threshold) == is_above ? 1.0 : 0.0;
    });
    typename Team::template Sums<1> own(team_);
    own.add(0, count_, [&space](int i) { return Terms<1>{{space.own[i]}}; });
    own_count_ = int(own.total().of[0]);
  }

  // Two groups of heights.
  struct Groups {
    double threshold = 0, below = 0;  // between them, and the share of the points below it
    double gap = 0;                   // between their means
    double variance = 0, within = 0;  // of all heights, and what of it is within the groups
  };

  // Of the heights, by two-means. O(n).
  POINTFAIR_INLINE Groups groups() {
    const FitSpace<kMost>& space = space_;
    const double n = count_;
    double threshold = 0, below = 0, low = 0, high = 0;
    for (int round = 0; round < kGroupingRounds; ++round) {
      typename Team::template Sums<2> sums(team_);
      sums.add(0, count_, [&space, threshold](int i) {
        const double h = space.height[i];
        return Terms<2>{{h < threshold ? 1.0 : 0.0, smaller(h, threshold)}};
      });
      const Terms<2> found = sums.total();
      below = found.of[0];
      if (below == 0 || below == n) return {};  // no two
      const double sum_below = found.of[1] - (n - below) * threshold;
      low = sum_below / below;
      high = -sum_below / (n - below);  // heights are over the mean
      const double middle = (low + high) / 2;
      if (middle == threshold) break;
      threshold = middle;
    }
    const double between = below * (n - below) / (n * n) * (high - low) * (high - low);
    return {threshold, below / n, high - low, plane_.variance, plane_.variance - between};
  }

  // The variance of one sheet's heights over that of its group: where sheets overlap, heights beyond the threshold
  // count for the other one. Of two equal sheets with Gaussian heights, within .01 where these are 2.4 sigmas apart or
  // more.
  POINTFAIR_INLINE double cut_off_by_groups() const {
    if (gap_ == 0) return 1;
    const double share = groups_.within / groups_.variance, squared = share * share;
    return 1 + 53 * (squared * squared);
  }

  // Whether the groups are two sheets. `thin`: those of a cloud of thin parts. O(n).
  POINTFAIR_INLINE bool are_sheets(bool thin) {
    if (groups_.within >= (thin ? kMixedVarianceOfThin : kMixedVariance) * groups_.variance) return false;
    if (groups_.within < kSheetVariance * groups_.variance) return true;
    return groups_.gap >=
               (thin ? kLeastGapOfThin : kLeastGap) * radius_ * square_root(2 * 3.141592653589793 / count_) &&
           lie_over_each_other(groups_.threshold, groups_.below);
  }

  // Whether the groups of heights below and above `threshold` lie over each other, as sheets do: the points beside the
  // points of one group are of either group, nearly as often as chance has it. `share`: of the points below. O(n).
  POINTFAIR_INLINE bool lie_over_each_other(double threshold, double share) {
    const FitSpace<kMost>& space = space_;
    const int count = count_, asked = count < kAsked ? count : kAsked;
    const Offset normal = plane_.normal;
    typename Team::template Sums<1> alike(team_);
    alike.add(0, asked, [&space, normal, threshold, count](int i) {
      const Offset here = space.offset(i);
      double nearest = 1e300;
      bool is_alike = false;
      for (int j = 0; j < count; ++j) {
        const double squared = squared_length(cross(space.offset(j) - here, normal));
        if (j == i || !(squared < nearest)) continue;
        nearest = squared;
        is_alike = (space.height[j] < threshold) == (space.height[i] < threshold);
      }
      return Terms<1>{{is_alike ? 1.0 : 0.0}};
    });
    const double chance = share * share + (1 - share) * (1 - share);
    return alike.total().of[0] < (1 + chance) / 2 * asked;
  }

  // Coordinates of the own points in any frame of the plane, in radii, and their heights.
  POINTFAIR_INLINE void place_over_plane() {
    const Plane plane = plane_;
    FitSpace<kMost>& space = space_;
    const Offset n = plane.normal;
    const Offset across = n.x * n.x < 0.5 ? cross(n, {1, 0, 0}) : cross(n, {0, 1, 0});
    const Offset axis = (1 / length(across)) * across, other = cross(n, axis);
    const double scale = 1 / radius_;
    team_.for_each(count_, [&space, plane, axis, other, scale](int i) {
      const Offset d = space.own[i] * (space.offset(i) - plane.centroid);
      space.u[i] = dot(d, axis) * scale;
      space.v[i] = dot(d, other) * scale;
      space.height[i] = dot(d, plane.normal);
    });
  }

  POINTFAIR_INLINE Terms<kCubicTerms> fitted_cubic() const {
    const FitSpace<kMost>& space = space_;
    Terms<kCubicTerms> cubic;
    for_constants<kCubicTerms>([&](auto t) { cubic.of[t.value] = space.equations[t.value][kCubicTerms]; });
    return cubic;
  }
  POINTFAIR_INLINE static double over_cubic(const FitSpace<kMost>& space, const Terms<kCubicTerms>& cubic, int i) {
    const double(&c)[kCubicTerms] = cubic.of;
    const double u = space.u[i], v = space.v[i];
    const double on_cubic = (c[0] * space.own[i] + u * (c[1] + u * (c[3] + u * c[6]))) +
                            v * ((c[2] + u * (c[4] + u * c[7])) + v * ((c[5] + u * c[8]) + v * c[9]));
    return space.height[i] - on_cubic;
  }

  // By the normal equations and Gauss-Jordan elimination; a vanishing pivot drops its term. The coefficients become the
  // last column.
  POINTFAIR_INLINE void fit_cubic() {
    FitSpace<kMost>& space = space_;
    typename Team::template Sums<kProducts + kCubicTerms> sums(team_);
    sums.add(0, count_, [&space](int i) { return products(space.own[i], space.u[i], space.v[i], space.height[i]); });
    const auto total = sums.total();
    team_.for_each(1, [&space, &total](int) {
      for_constants<kProducts + kCubicTerms>([&](auto t) { space.sums[t.value] = total.of[t.value]; });
    });
    team_.for_each(kCubicTerms, [&space](int i) {
      const Powers p = powers_of(i);
      for_constants<kCubicTerms>([&](auto j) {
        constexpr Powers q = powers_of(decltype(j)::value);
        space.equations[i][j.value] = space.sums[term_of({p.u + q.u, p.v + q.v})];
      });
      space.equations[i][kCubicTerms] = space.sums[kProducts + i];
    });
    for (int i = 0; i < kCubicTerms; ++i) {
      const double pivot = space.equations[i][i];
      const bool vanishes = pivot < kVanishing * own_count_;
      // columns up to i are not read again
      team_.for_each(kCubicTerms - i, [&space, i, pivot, vanishes](int j) {
        double& value = space.equations[i][i + 1 + j];
        value = vanishes ? 0 : value / pivot;
      });
      team_.for_each(kCubicTerms, [&space, i](int r) {
        if (r == i) return;
        const double factor = space.equations[r][i];
        for (int j = i + 1; j <= kCubicTerms; ++j) space.equations[r][j] -= factor * space.equations[i][j];
      });
    }
  }

  // Of one point: u^p v^q up to the degree of products of two terms, then each term times the height.
  POINTFAIR_INLINE static Terms<kProducts + kCubicTerms> products(double own, double u, double v, double height) {
    double of_u[7] = {own}, of_v[7] = {1};
    for_constants<6>([&](auto p) {
      of_u[p.value + 1] = of_u[p.value] * u;
      of_v[p.value + 1] = of_v[p.value] * v;
    });
    Terms<kProducts + kCubicTerms> terms;
    for_constants<kProducts>([&](auto t) {
      constexpr int term = decltype(t)::value;
      constexpr Powers p = powers_of(term);
      terms.of[term] = of_u[p.u] * of_v[p.v];
      if constexpr (kCubicTerms > term) terms.of[kProducts + term] = terms.of[term] * height;
    });
    return terms;
  }

  Team team_;
  FitSpace<kMost>& space_;
  bool sheets_;
  Groups groups_{};
  int count_ = 0;
  typename Team::template Sums<kMoments> moments_{team_};  // of all `count_`
  double radius_ = 0;
  bool is_surface_ = false;
  int own_count_ = 0;  // all, or fewer where there are two sheets
  double gap_ = 0;
  double residuals_ = 0;  // their variance
  Plane plane_{};         // of the own ones
};

}  // namespace pointfair::point
