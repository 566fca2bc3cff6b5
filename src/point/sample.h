// SPDX-License-Identifier: Apache-2.0
// What estimates (src/estimate) read from a row of nearest points at one sample of a cloud. A row is the sample itself
// and then its nearest other points, nearest first, with NaN behind the last one. The row of an invalid sample is all
// NaN.
#pragma once

#include "point/surface_fit.h"

namespace pointfair::point {

struct SpacingSample {
  double mean = -1, last = -1;  // distances to the nearest; negative of a sample that has none
};

// The noise where the neighbourhood is first wide against it.
struct NoiseSample {
  bool is_short = false;  // the whole row is not wide enough, and a longer row could be
  bool shows_noise = false;
  bool is_wide = false;        // against the noise; else the neighbourhood is as large as it may get
  bool may_be_sheets = false;  // GrowingNeighborhood::may_be_sheets()
  bool is_tube = false;        // GrowingNeighborhood::is_tube(), which shows no noise
  double sigma = 0, spacing = 0, gap = 0;
};

// The sizes of neighbourhoods that planes are fitted to: each has 1.8 times as many points as the one before.
inline constexpr int kPlaneSizes = 6;
POINTFAIR_INLINE constexpr int plane_points(int size) {
  constexpr int kPoints[kPlaneSizes] = {6, 11, 20, 36, 64, 115};
  return kPoints[size];
}

// Variances of the sample and its first 6 to 115 points over their plane, unbiased: n - 3 for n; negative where there
// are fewer points, or where they lie along a line.
struct PlaneSample {
  double variance[kPlaneSizes] = {-1, -1, -1, -1, -1, -1};
};

// The noise by the first 20, 30, 60 and 115 points; negative where they show none.
struct ResidualSample {
  double least = -1, narrow = -1, wide = -1, widest = -1;
  PlaneSample planes;
};

inline constexpr int kSpacingNeighbors = 6;
// A neighbourhood grows until it is wide against the noise, in rounds of 30, 42, 58, .. 600 points, each 1.4 times the
// one before. Rows are asked for in two lengths: a row of the nearest begins with every shorter one, so each serves
// half of the rounds.
inline constexpr int kLeastFit = 20, kFirstFit = 30, kFirstRow = 115, kLastRow = 600;
// Of a row: the sample and those that show steps of coordinates (src/estimate/coordinate_steps.cpp) or that there are
// copies (src/estimate/repeats.cpp).
inline constexpr int kHeadRow = 18;
// The same with those that may hide a surface (src/estimate/hidden_surface.cpp), and of how many rows, the first ones.
inline constexpr int kNearRow = 33, kNearRows = 500;
// Samples whose residuals stand for one place (src/estimate/noise_levels.cpp).
inline constexpr int kPool = 16;
inline constexpr int kFirstRounds = 5, kRounds = 10;
POINTFAIR_INLINE constexpr int points_of(int round) {
  double points = kFirstFit;
  for (int r = 0; r < round; ++r) points *= 1.4;
  return points < kLastRow ? int(points) : kLastRow;
}
static_assert(points_of(kFirstRounds - 1) == kFirstRow && points_of(kRounds - 1) == kLastRow);

// What so many of the nearest points show.
struct Look {
  bool is_wide = false;  // against the noise
  bool is_last = true;   // there are no more, or more are not looked at
  bool is_cut = true;    // there are fewer
  bool may_be_sheets = false, is_tube = false;
  double noise = -1;  // negative: they show none
  double spacing = 0, gap = 0;
};

template <class P>
POINTFAIR_INLINE Offset offset_between(const P& from, const P& to) {
  return {double(to.x) - double(from.x), double(to.y) - double(from.y), double(to.z) - double(from.z)};
}

template <class P>
POINTFAIR_INLINE SpacingSample spacing_sample(const P* row) {
  double total = 0, last = -1;
  int found = 0;
  for (; found < kSpacingNeighbors && row[found + 1].x == row[found + 1].x; ++found)
    total += last = length(offset_between(row[0], row[found + 1]));
  return found > 0 ? SpacingSample{total / found, last} : SpacingSample{};
}

// What take_row() found in a row: how many places, and whether the cloud may have more.
struct RowTaken {
  int there;
  bool may_have_more;
};

// Takes the offsets of a row of kMost. Points at one place follow each other, and all but the first are left out: a
// point that a cloud holds twice is no second measurement.
template <class Team, int kMost, class Row>
POINTFAIR_INLINE RowTaken take_row(Team team, FitSpace<kMost>& space, Row row) {
  team.for_each(kMost, [&space, row](int i) {
    const Offset o = offset_between(row[0], row[i + 1]);
    space.x[i] = o.x;
    space.y[i] = o.y;
    space.z[i] = o.z;
  });
  const auto is_repeated = [&space](int i) {
    const Offset before = i > 0 ? space.offset(i - 1) : Offset{0, 0, 0};
    return space.x[i] == before.x && space.y[i] == before.y && space.z[i] == before.z;
  };
  typename Team::template Sums<2> counts(team);
  counts.add(0, kMost, [&space, &is_repeated](int i) {
    return Terms<2>{{space.x[i] == space.x[i] ? 1.0 : 0.0, is_repeated(i) ? 1.0 : 0.0}};
  });
  const Terms<2> found = counts.total();
  const int known = int(found.of[0]), repeated = int(found.of[1]);
  if (repeated > 0) {
    team.for_each(1, [&space, known](int) {
      Offset before{0, 0, 0};
      for (int i = 0, to = 0; i < known; ++i) {
        const Offset o = space.offset(i);
        if (o.x == before.x && o.y == before.y && o.z == before.z) continue;
        space.x[to] = o.x;
        space.y[to] = o.y;
        space.z[to++] = o.z;
        before = o;
      }
    });
  }
  return {known - repeated, known == kMost && kMost < kLastRow};
}

// A look at the nearest `points`, or at all that are there. The noise of a neighbourhood that is neither wide nor the
// last one is computed only if `always`.
template <class Team, int kMost>
POINTFAIR_INLINE Look look_at(GrowingNeighborhood<Team, kMost>& neighborhood, RowTaken row, int points, bool always) {
  Look look;
  look.is_cut = row.there < points;
  look.is_last = (look.is_cut && !row.may_have_more) || points == kLastRow;
  if (row.there < kFirstFit / 2) return look;
  neighborhood.grow_to(look.is_cut ? row.there : points);
  look.is_wide = neighborhood.is_wide();
  if (!neighborhood.shows_a_surface() || !(look.is_wide || look.is_last || always)) return look;
  look.is_tube = look.is_wide && neighborhood.is_tube();
  look.may_be_sheets = look.is_wide && neighborhood.may_be_sheets();
  look.noise = neighborhood.noise();
  look.spacing = neighborhood.spacing();
  look.gap = neighborhood.gap();
  return look;
}

// Calls look_in(round) for each round from `first` to before `end`, until one suffices.
template <class LookIn>
POINTFAIR_INLINE NoiseSample noise_sample(int first, int end, const LookIn& look_in) {
  for (int round = first; round < end; ++round) {
    const Look look = look_in(round);
    if (!look.is_wide && !look.is_last) continue;
    if (look.noise < 0) return {};
    return {false, !look.is_tube, look.is_wide, look.may_be_sheets, look.is_tube, look.noise, look.spacing, look.gap};
  }
  return {true};
}

// The lesser variance along a plane over the greater one: points with less lie along a line.
inline constexpr double kRound = 0.2;

// The planes of a row that holds `there` points.
template <class Team, int kMost>
POINTFAIR_INLINE PlaneSample plane_sample(Team team, const FitSpace<kMost>& space, int there) {
  PlaneSample planes;
  typename Team::template Sums<kMoments> sums(team);
  for (int size = 0, first = 0; size < kPlaneSizes; ++size) {
    const int points = plane_points(size);
    if (points > there) break;
    sums.add(first, points, [&space](int i) { return moments(space.offset(i), 1); });
    first = points;
    const double n = points + 1;  // the sample adds nothing to the sums
    const Plane plane = plane_of(sums.total(), n);
    if (plane.exists && plane.roundness >= kRound) planes.variance[size] = plane.variance * n / (n - 3);
  }
  return planes;
}

// The residuals of looks at 20, 30, 60 and 115 points.
POINTFAIR_INLINE ResidualSample residual_sample(const Look& least, const Look& narrow, const Look& wide,
                                                const Look& widest, const PlaneSample& planes) {
  if (wide.is_cut) return {-1, -1, -1, -1, planes};
  return {least.noise, narrow.noise, wide.noise, widest.is_cut ? -1 : widest.noise, planes};
}

}  // namespace pointfair::point
