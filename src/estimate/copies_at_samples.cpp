// SPDX-License-Identifier: Apache-2.0
#include "estimate/copies_at_samples.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/moments.hpp"
#include "estimate/quantile.hpp"
#include "point/sample.h"

namespace pointfair {
namespace {

using namespace constants;
using point::Offset;

// Squared distances to the neighbours of the ranks from `first` to `last`, of rows that have so many.
template <class Visit>
void for_squared_distances(std::span<const Point> rows, int neighbors, int first, int last, const Visit& visit) {
  const std::size_t row = std::size_t(neighbors) + 1;
  for (std::size_t at = 0; at < rows.size(); at += row) {
    if (std::isnan(rows[at + row - 1].x)) continue;
    for (int k = first; k <= last; ++k)
      visit(point::squared_length(point::offset_between(rows[at], rows[at + std::size_t(k)])));
  }
}
std::vector<double> squared_distances(std::span<const Point> rows, int neighbors, int first, int last) {
  std::vector<double> squared;
  for_squared_distances(rows, neighbors, first, last, [&](double its) { squared.push_back(its); });
  return squared;
}

// Whether a gap is possible at all: by counts in bins of an eighth of an octave, of squared distances. Distances nine
// times those of a bin are at least eight times its end, which is 24 bins on.
bool may_end_before_a_gap(std::span<const Point> rows, int neighbors, double least, double most) {
  static_assert(kBeyondCopies == 3);
  constexpr std::size_t kBins = 2048, kGap = 24;
  const auto bin_of = [](double squared) { return std::size_t(std::bit_cast<std::uint32_t>(float(squared)) >> 20); };
  std::array<std::uint32_t, kBins> counts{};
  for_squared_distances(rows, neighbors, 1, neighbors, [&](double its) { ++counts[bin_of(its)]; });
  std::partial_sum(counts.begin(), counts.end(), counts.begin());
  for (std::size_t bin = bin_of(least); bin <= std::min(bin_of(most), kBins - 1 - kGap); ++bin)
    if (double(counts[bin + kGap] - counts[bin]) <= kFewOthers * double(counts[bin])) return true;
  return false;
}

// How far nearly all copies lie off at most, 0 where they are at one place; negative: there are none. Copies are the
// points up to the greatest distance beyond which, up to kBeyondCopies times it, few others lie: of points there by
// chance, kChanceBeyond times as many would. Distances count so far that most rows hold all within kBeyondCopies times
// them.
double width_of_copies(std::span<const Point> rows, int neighbors) {
  constexpr double kBeyond = kBeyondCopies * kBeyondCopies, kChanceBeyond = kBeyond - 1;  // on a surface
  const std::vector<double> nearest = squared_distances(rows, neighbors, 1, 1);
  if (nearest.size() < kFewestCopies) return -1;
  const double least = nth(nearest, kFewestCopies - 1),
               most = quantile(squared_distances(rows, neighbors, neighbors, neighbors), kFullRows) / kBeyond;
  if (!(least < most) || !may_end_before_a_gap(rows, neighbors, least, most)) return -1;
  std::vector<double> all = squared_distances(rows, neighbors, 1, neighbors);
  std::ranges::sort(all);
  const auto count_up_to = [&](double squared) {
    return std::size_t(std::ranges::upper_bound(all, squared) - all.begin());
  };
  for (std::size_t within = count_up_to(most); within > 0 && all[within - 1] >= least; --within) {
    const double others = double(count_up_to(kBeyond * all[within - 1]) - count_up_to(all[within - 1]));
    if (others <= kFewOthers * double(within))
      return std::sqrt(all[std::size_t(kNearlyAll * (double(within) - others / kChanceBeyond))]);
  }
  return -1;
}

// Of the places of a row that are no copies: the least difference of a coordinate; kEndless: none.
double least_step(std::span<const Offset> offsets, double within) {
  double step = kEndless;
  for (const Offset& o : offsets)
    if (point::length(o) > within)
      for (const double along : {o.x, o.y, o.z})
        if (std::abs(along) > within) step = std::min(step, std::abs(along));
  return step;
}

}  // namespace

CopiesFound copies_at_samples(const NearestRows& nearest, const ForEach& for_each) {
  constexpr int kHead = kMostRepeats + 1;
  static_assert(kHead < point::kHeadRow);
  const double width = width_of_copies(nearest.of(nearest.looked_at(), kHead), kHead);
  if (width < 0) return {};
  const double within = kWithinCopies * width;
  constexpr std::size_t kRow = kRepeatNeighbors + 1;
  const std::vector<Point> rows = nearest.of(nearest.looked_at(), kRepeatNeighbors);
  std::vector<std::vector<Offset>> of_rows(rows.size() / kRow);  // empty of those that are not full
  std::vector<double> step_of(of_rows.size());
  for_each(of_rows.size(), [&](std::size_t i) {
    const auto row = std::span(rows).subspan(i * kRow, kRow);
    if (std::isnan(row.back().x)) return;
    of_rows[i] = offsets_of(row);
    step_of[i] = least_step(of_rows[i], within);
  });
  std::vector<double> steps;
  for (std::size_t i = 0; i < of_rows.size(); ++i)
    if (!of_rows[i].empty()) steps.push_back(step_of[i]);
  if (steps.empty()) return {};
  const std::size_t full = steps.size();
  const double by_chance = std::max(within, kStepsOfChance * median(std::move(steps)));
  double measurements = 0;  // that the samples are, and so many points
  std::size_t copies = 0, within_steps = 0;
  for (const std::vector<Offset>& offsets : of_rows) {
    if (offsets.empty()) continue;
    const auto count = [&](double distance) {
      return std::size_t(std::ranges::count_if(offsets, [&](const Offset& o) { return point::length(o) <= distance; }));
    };
    measurements += 1 / double(count(within));
    copies += count(within) - 1;
    within_steps += count(by_chance) - 1;
  }
  if (within_steps > kMostOfSteps * copies) return {};
  return {double(full) / measurements, within};
}

}  // namespace pointfair
