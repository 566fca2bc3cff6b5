// SPDX-License-Identifier: Apache-2.0
#include "estimate/repeats.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"
#include "estimate/row_offsets.hpp"
#include "point/sample.h"

namespace pointfair {
namespace {

using namespace constants;

// Medians over the rows of the squared distance to the k-th nearest, over k; k from 1 on. Short rows do not count.
std::vector<double> squared_distances_by_rank(std::span<const Point> rows, int neighbors) {
  const std::size_t row = std::size_t(neighbors) + 1;
  std::vector<double> result, of_rank;
  for (std::size_t k = 1; k < row; ++k) {
    of_rank.clear();
    for (std::size_t first = 0; first < rows.size(); first += row) {
      if (std::isnan(rows[first + row - 1].x)) continue;
      of_rank.push_back(point::squared_length(point::offset_between(rows[first], rows[first + k])) / double(k));
    }
    if (of_rank.empty()) return {};
    result.push_back(median(of_rank));
  }
  return result;
}

// The first rank from which on distances are those of points spread over a surface.
int first_even(const std::vector<double>& by_rank) {
  if (by_rank.empty()) return 1;
  int rank = 1;
  while (std::size_t(rank) < by_rank.size() && by_rank[std::size_t(rank) - 1] <= kEvenDistances * by_rank.back())
    ++rank;
  return rank;
}

}  // namespace

Repeats repeats_among(const NearestRows& nearest, const ForEach& for_each) {
  if (rows_share_errors(nearest, for_each)) return {kMostRepeats};
  if (first_even(squared_distances_by_rank(nearest.heads(), kStepNeighbors)) == 1) return {};
  const std::vector<Point> rows = nearest.of(nearest.looked_at(), kRepeatNeighbors);
  const std::vector<double> by_rank = squared_distances_by_rank(rows, kRepeatNeighbors);
  const auto elsewhere = std::ranges::find_if(by_rank, [](double squared) { return squared > 0; });
  return {std::min(first_even(by_rank), kMostRepeats), 1 + int(elsewhere - by_rank.begin())};
}

}  // namespace pointfair
