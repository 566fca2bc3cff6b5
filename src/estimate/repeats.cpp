// SPDX-License-Identifier: Apache-2.0
#include "estimate/repeats.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
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

// The direction of points that lie along a line.
std::optional<Offset> line_through(std::span<const Offset> offsets) {
  const Moments moments(offsets);
  const auto& m = moments.second;
  const double trace = moments.trace();
  if (!(trace > 0) || !moments.lie_along_a_line()) return std::nullopt;
  const auto direction =
      point::least_eigenvector(point::Sym3<double>{trace - m.xx, -m.xy, -m.xz, trace - m.yy, -m.yz, trace - m.zz});
  return direction.exists ? std::optional(direction.unit) : std::nullopt;
}

// A point of a neighbourhood: along the rows, across them, above the plane.
struct Local {
  double along, across, height;
};

std::vector<Local> in_rows(std::span<const Offset> offsets, Offset line) {
  const auto normal = point::least_eigenvector(Moments(offsets).second);
  const Offset across = point::cross(normal.unit, line);
  const double size = point::length(across);
  if (!normal.exists || !(size > 0.1)) return {};
  const Offset right = (1 / size) * across, forward = point::cross(right, normal.unit);
  std::vector<Local> points;
  for (const Offset& o : offsets) points.push_back({dot(o, forward), dot(o, right), dot(o, normal.unit)});
  std::ranges::sort(points, {}, &Local::across);
  return points;
}

// The line of a row's heights, at the sample.
struct RowLine {
  double across, height;
  double squares, freedom;  // of its points' heights over it
};

std::optional<RowLine> line_of(std::span<const Local> row) {
  if (row.size() < kFewestOfRow) return std::nullopt;
  const double n = double(row.size());
  double along = 0, across = 0, height = 0;
  for (const Local& p : row) along += p.along / n, across += p.across / n, height += p.height / n;
  double spread = 0, slope = 0, squares = 0;
  bool before = false, behind = false;
  for (const Local& p : row) {
    spread += (p.along - along) * (p.along - along);
    slope += (p.along - along) * p.height;
    before = before || p.along < 0;
    behind = behind || p.along > 0;
  }
  if (!before || !behind || !(spread > 0)) return std::nullopt;  // it does not pass by the sample
  slope /= spread;
  for (const Local& p : row) {
    const double off = p.height - height - slope * (p.along - along);
    squares += off * off;
  }
  return RowLine{across, height - slope * along, squares, n - 2};
}

// Rows, where points across them leave gaps.
std::vector<RowLine> rows_of(std::span<const Local> points) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < points.size(); ++i) gaps.push_back(points[i].across - points[i - 1].across);
  if (gaps.empty()) return {};
  const double extent = points.back().across - points.front().across,
               least = std::max(kGapOfRows * median(gaps), extent / kMostRows);
  std::vector<RowLine> rows;
  for (std::size_t first = 0, i = 1; i <= points.size(); ++i) {
    if (i < points.size() && points[i].across - points[i - 1].across <= least) continue;
    if (const auto row = line_of(points.subspan(first, i - first))) rows.push_back(*row);
    first = i;
  }
  return rows;
}

// What the rows' heights leave over a parabola across them, by least squares.
std::vector<double> residuals_of(std::span<const RowLine> rows) {
  double size = 0;
  for (const RowLine& row : rows) size = std::max(size, std::abs(row.across));
  point::Sym3<double> m{};
  Offset right{};
  for (const RowLine& row : rows) {
    const double t = size > 0 ? row.across / size : 0;
    m = {m.xx + 1, m.xy + t, m.xz + t * t, m.yy + t * t, m.yz + t * t * t, m.zz + t * t * t * t};
    right = right + row.height * Offset{1, t, t * t};
  }
  // by Cramer's rule: the columns of the adjugate are cross products of the rows
  const Offset a{m.xx, m.xy, m.xz}, b{m.xy, m.yy, m.yz}, c{m.xz, m.yz, m.zz};
  const double determinant = dot(a, point::cross(b, c));
  if (!(determinant > 0)) return {};
  const Offset found =
      (1 / determinant) * (right.x * point::cross(b, c) + right.y * point::cross(c, a) + right.z * point::cross(a, b));
  std::vector<double> residuals;
  for (const RowLine& row : rows) {
    const double t = row.across / size;
    residuals.push_back(row.height - dot(found, Offset{1, t, t * t}));
  }
  return residuals;
}

// Of the rows around one sample.
struct RowJumps {
  double offset = -1;  // how far rows lie off, in standard deviations of their points about them; -1: no rows
  double jump = 0;     // mean square of successive differences over the mean square: 2 of chance, less of shape (von
                       // Neumann 1941)
};

RowJumps jumps_around(std::span<const Point> row, Offset line) {
  const std::vector<Offset> offsets = offsets_of(row);
  const std::vector<Local> points = in_rows(offsets, line);
  const std::vector<RowLine> rows = rows_of(points);
  if (rows.size() < kFewestRows) return {};
  const std::vector<double> off = residuals_of(rows);
  double squares = 0, differences = 0, within = 0, freedom = 0;
  for (std::size_t i = 0; i < off.size(); ++i) {
    squares += off[i] * off[i];
    if (i > 0) differences += (off[i] - off[i - 1]) * (off[i] - off[i - 1]);
    within += rows[i].squares;
    freedom += rows[i].freedom;
  }
  if (!(squares > 0 && within > 0)) return {};
  return {std::sqrt(squares / double(rows.size() - 3) / (within / freedom)), differences / squares};
}

// Rows of points that share an error each, as the rings of a lidar whose beams are off from each other: whether rows
// lie off a smooth surface by more than their own points do, each row by an error of its own: from row to row these
// jump, where shape goes on. Asks for few long rows of neighbours, where the nearest points lie along lines.
bool rows_share_errors(const NearestRows& nearest, const ForEach& for_each) {
  const std::vector<Point>& heads = nearest.heads();
  constexpr std::size_t kHead = kStepNeighbors + 1, kLong = kRowNeighbors + 1;
  const std::size_t looked_at = std::min(heads.size() / kHead, kRowSamples);
  std::vector<std::optional<Offset>> lines;
  std::size_t in_lines = 0;
  for (std::size_t i = 0; i < looked_at; ++i) {
    lines.push_back(line_through(offsets_of(std::span(heads).subspan(i * kHead, kHead))));
    in_lines += lines.back().has_value();
  }
  if (double(in_lines) < kRowShare * double(looked_at)) return false;
  const std::vector<Point> rows = nearest.of(looked_at, kRowNeighbors);
  std::vector<RowJumps> at_samples(looked_at);
  for_each(looked_at, [&](std::size_t i) {
    if (lines[i]) at_samples[i] = jumps_around(std::span(rows).subspan(i * kLong, kLong), *lines[i]);
  });
  std::vector<double> offsets, jumps;
  for (const RowJumps& its : at_samples) {
    if (its.offset < 0) continue;
    offsets.push_back(its.offset);
    jumps.push_back(its.jump);
  }
  if (offsets.empty() || double(offsets.size()) < kRowShare * double(looked_at)) return false;
  const double offset = median(offsets);
  return offset > kLeastRowOffset && offset < kMostRowOffset && median(jumps) > kRowJump;
}

// Median over the rows of the squared distance to the k-th nearest, over k. Short rows do not count; negative if all
// are.
double squared_distance_at_rank(std::span<const Point> rows, int neighbors, int k) {
  const std::size_t row = std::size_t(neighbors) + 1;
  std::vector<double> of_rank;
  of_rank.reserve(rows.size() / row);
  for (std::size_t first = 0; first < rows.size(); first += row) {
    if (std::isnan(rows[first + row - 1].x)) continue;
    of_rank.push_back(point::squared_length(point::offset_between(rows[first], rows[first + std::size_t(k)])) / k);
  }
  return of_rank.empty() ? -1 : median(std::move(of_rank));
}

// From the first rank on; empty if all rows are short.
std::vector<double> squared_distances_by_rank(std::span<const Point> rows, int neighbors, const ForEach& for_each) {
  if (squared_distance_at_rank(rows, neighbors, 1) < 0) return {};
  std::vector<double> result(static_cast<std::size_t>(neighbors));
  for_each(result.size(), [&](std::size_t i) { result[i] = squared_distance_at_rank(rows, neighbors, int(i) + 1); });
  return result;
}

// Whether the nearest points lie nearer than those of points spread over a surface, or all at one place.
bool are_uneven(std::span<const Point> rows, int neighbors) {
  const double nearest = squared_distance_at_rank(rows, neighbors, 1);
  return nearest >= 0 && nearest <= kEvenDistances * squared_distance_at_rank(rows, neighbors, neighbors);
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
  if (rows_share_errors(nearest, for_each)) return {.points = kMostRepeats, .rows_share_errors = true};
  if (!are_uneven(nearest.heads(), kStepNeighbors)) return {};
  const std::vector<Point> rows = nearest.of(nearest.looked_at(), kRepeatNeighbors);
  const std::vector<double> by_rank = squared_distances_by_rank(rows, kRepeatNeighbors, for_each);
  const auto elsewhere = std::ranges::find_if(by_rank, [](double squared) { return squared > 0; });
  return {std::min(first_even(by_rank), kMostRepeats), 1 + int(elsewhere - by_rank.begin())};
}

}  // namespace pointfair
