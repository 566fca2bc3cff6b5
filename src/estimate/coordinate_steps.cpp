// SPDX-License-Identifier: Apache-2.0
#include "estimate/coordinate_steps.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "estimate/constants.hpp"
#include "estimate/moments.hpp"
#include "estimate/quantile.hpp"

namespace pointfair {
namespace {

using point::Offset;

using namespace constants;

constexpr std::size_t kRow = kStepNeighbors + 1;
static_assert(kRow <= point::kHeadRow);

double coordinate(const Point& p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

// The sorted values without those that lie within `apart` behind another one.
std::vector<double> distinct_of_sorted(const std::vector<double>& values, double apart) {
  std::vector<double> result;
  double last = 0;
  for (const double value : values) {
    if (result.empty() || value - last > apart) result.push_back(value);
    last = value;
  }
  return result;
}

std::vector<double> distinct(std::vector<double> values, double apart) {
  std::ranges::sort(values);
  return distinct_of_sorted(values, apart);
}

// In parts, which are merged two by two.
void sort_many(std::vector<double>& values, const ForEach& for_each) {
  constexpr std::size_t kParts = 16;
  const auto part = [&](std::size_t p) { return values.begin() + std::ptrdiff_t(p * values.size() / kParts); };
  for_each(kParts, [&](std::size_t p) { std::sort(part(p), part(p + 1)); });
  for (std::size_t size = 1; size < kParts; size *= 2)
    for_each(kParts / (2 * size), [&](std::size_t pair) {
      const std::size_t p = 2 * size * pair;
      std::inplace_merge(part(p), part(p + size), part(p + 2 * size));
    });
}

double extent_of(std::span<const Point> points) {
  double extent = 0;
  for (const Point& p : points)
    for (int axis = 0; axis < 3 && !std::isnan(p.x); ++axis)
      extent = std::max(extent, std::abs(coordinate(p, axis) - coordinate(points[0], axis)));
  return extent;
}

// The step along one axis, from differences between neighbours; 0 where there is none.
double grid_step(std::span<const Point> rows, int axis, double rounding) {
  std::vector<double> differences;
  for (std::size_t first = 0; first < rows.size(); first += kRow)
    for (std::size_t i = 1; i < kRow; ++i) {
      const double difference = std::abs(coordinate(rows[first + i], axis) - coordinate(rows[first], axis));
      if (difference > rounding) differences.push_back(difference);
    }
  if (differences.empty()) return 0;
  const std::size_t all = differences.size();
  if (all >= kGlance && 2 * distinct({differences.begin(), differences.begin() + kGlance}, rounding).size() > kGlance)
    return 0;
  const std::vector<double> values = distinct(std::move(differences), rounding);
  if (values.size() * kRepeats > all) return 0;
  std::vector<double> gaps;
  for (std::size_t i = 0; i < values.size(); ++i) gaps.push_back(values[i] - (i > 0 ? values[i - 1] : 0));
  const double step = median(gaps);
  const auto alike =
      std::ranges::count_if(gaps, [step](double gap) { return std::abs(gap - step) < kSameStep * step; });
  return 2 * std::size_t(alike) > gaps.size() && rounding < kSameStep * step ? step : 0;
}

// Whether points lie on the nodes of a regular mesh: each alone, and its two nearest points a step away. Then no
// coordinate was rounded.
bool is_mesh(std::span<const Point> rows, double step) {
  std::size_t regular = 0;
  for (std::size_t first = 0; first < rows.size(); first += kRow) {
    const double nearest = point::length(point::offset_between(rows[first], rows[first + 1])),
                 second = point::length(point::offset_between(rows[first], rows[first + 2]));
    regular += std::abs(nearest - step) < kSameStep * step && std::abs(second - step) < kSameStep * step;
  }
  return double(regular * kRow) > kRegularShare * double(rows.size());
}

// A flat cloud of rows and columns has steps along two axes, and no noise for it.
double step_of_grid(std::span<const Point> rows, double rounding) {
  const double step = grid_step(rows, 0, rounding);
  for (int axis = 1; axis < 3 && step > 0; ++axis)
    if (std::abs(grid_step(rows, axis, rounding) - step) > kSameStep * step) return 0;
  return step > 0 && is_mesh(rows, step) ? 0 : step;
}

// The step along one axis, where neighbours show one, or the least gap between the few values of a step so coarse that
// neighbours share them; 0 where there is none.
double step_or_gap(std::span<const Point> rows, int axis, double rounding) {
  if (const double step = grid_step(rows, axis, rounding); step > 0) return step;
  std::vector<double> values;
  for (const Point& p : rows) values.push_back(coordinate(p, axis));
  const auto are_few = [&](const std::vector<double>& levels) { return levels.size() * kRepeats <= rows.size(); };
  if (values.size() >= kGlance && !are_few(distinct({values.begin(), values.begin() + kGlance}, rounding))) return 0;
  const std::vector<double> levels = distinct(std::move(values), rounding);
  if (levels.size() < 2 || !are_few(levels)) return 0;
  double least = kEndless;
  for (std::size_t i = 1; i < levels.size(); ++i) least = std::min(least, levels[i] - levels[i - 1]);
  return least;
}

// As StepsInHeads::coarsest.
double coarsest_step(std::span<const Point> rows, double rounding) {
  std::vector<int> axes;
  double coarsest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double step = step_or_gap(rows, axis, rounding);
    if (step > 0) axes.push_back(axis);
    coarsest = std::max(coarsest, step);
  }
  if (axes.size() < 2) return 0;
  std::size_t over_each_other = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Point &first = rows[i - i % kRow], &other = rows[i];
    over_each_other += i % kRow > 0 && std::ranges::all_of(axes, [&](int axis) {
                         return std::abs(coordinate(other, axis) - coordinate(first, axis)) <= rounding;
                       });
  }
  return double(over_each_other) > kOverEachOther * double(rows.size()) ? coarsest : 0;
}

struct ExactPlane {
  Offset normal;
  Moments moments;
  Point place;
};

// The plane of a row that lies exactly on one.
std::optional<ExactPlane> exact_plane(std::span<const Point> row, double rounding) {
  const std::vector<Offset> offsets = offsets_of(row);
  const Moments moments(offsets);
  const auto normal = point::least_eigenvector(moments.second);
  if (!normal.exists) return std::nullopt;
  double farthest = 0, highest = 0;
  for (const Offset& o : offsets) {
    const Offset d = o - moments.centroid;
    farthest = std::max(farthest, point::length(d));
    highest = std::max(highest, std::abs(point::dot(d, normal.unit)));
  }
  if (highest > std::max(kExactPlane * farthest, rounding)) return std::nullopt;
  return ExactPlane{normal.unit, moments, row[0]};
}

// The direction that most exact planes face. None where these planes are few or lie on few levels: a flat face without
// noise is one level, and a scan without noise has a few of them.
std::optional<Offset> common_direction(std::span<const Point> rows, double rounding, const ForEach& for_each) {
  std::vector<std::optional<ExactPlane>> of_rows(rows.size() / kRow);
  for_each(of_rows.size(), [&](std::size_t n) { of_rows[n] = exact_plane(rows.subspan(n * kRow, kRow), rounding); });
  std::vector<ExactPlane> planes;
  for (const auto& plane : of_rows)
    if (plane && planes.size() < kMostPlanes) planes.push_back(*plane);
  const auto is_alike = [&planes](std::size_t i, std::size_t j) {
    return std::abs(point::dot(planes[i].normal, planes[j].normal)) > kSameDirection;
  };
  std::size_t most = 0, commonest = 0;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    std::size_t count = 0;
    for (std::size_t j = 0; j < planes.size(); ++j) count += is_alike(i, j);
    if (count > most) most = count, commonest = i;
  }
  if (most < kFewestPlanes) return std::nullopt;
  Moments moments;
  for (std::size_t j = 0; j < planes.size(); ++j)
    if (is_alike(commonest, j)) moments.add(planes[j].moments.second);
  const Offset direction = point::least_eigenvector(moments.second).unit;
  std::vector<double> heights;
  for (std::size_t j = 0; j < planes.size(); ++j)
    if (is_alike(commonest, j))
      heights.push_back(point::dot(point::offset_between(rows[0], planes[j].place), direction));
  if (distinct(std::move(heights), kLevelGap * extent_of(rows)).size() < kSpans) return std::nullopt;
  return direction;
}

// The gaps between the depths of whole disparities, which widen with the square of the distance.
struct DisparityLaw {
  double place, root, slope;  // the root of the gap at a place, and by how much it grows
  double gap_at(double at) const {
    const double there = root + slope * (at - place);
    return there * there;
  }
};

// The law of sorted levels, if they follow one. The profiles of a scanner that is driven past do not. Some levels are
// rounded or missing, so gaps are means over many levels, and the line through their roots goes by medians (Theil and
// Sen).
std::optional<DisparityLaw> disparity_law(const std::vector<double>& levels) {
  std::array<double, kSpans> place, root;
  for (std::size_t i = 0; i < kSpans; ++i) {
    const std::size_t from = i * (levels.size() - 1) / kSpans, to = (i + 1) * (levels.size() - 1) / kSpans;
    place[i] = (levels[from] + levels[to]) / 2;
    root[i] = std::sqrt((levels[to] - levels[from]) / double(to - from));
  }
  std::vector<double> slopes;
  for (std::size_t i = 0; i < kSpans; ++i)
    for (std::size_t j = 0; j < i; ++j) slopes.push_back((root[i] - root[j]) / (place[i] - place[j]));
  const double slope = median(std::move(slopes));
  std::vector<double> at_start;
  for (std::size_t i = 0; i < kSpans; ++i) at_start.push_back(root[i] - slope * (place[i] - place[0]));
  const DisparityLaw law{place[0], median(std::move(at_start)), slope};
  const auto [least, most] = std::minmax({law.gap_at(levels.front()), law.gap_at(levels.back())});
  if (most < kWideningOfGaps * least) return std::nullopt;
  return law;
}

// The step along a direction at each row's first point; empty where heights have no levels.
std::vector<double> steps_along(Offset direction, std::span<const Point> rows, std::size_t row_size,
                                const ForEach& for_each) {
  const auto height = [&](const Point& p) { return point::dot(point::offset_between(rows[0], p), direction); };
  std::vector<double> heights(rows.size());
  for_each(rows.size() / row_size, [&](std::size_t row) {
    for (std::size_t i = row * row_size; i < (row + 1) * row_size; ++i) heights[i] = height(rows[i]);
  });
  std::erase_if(heights, [](double known) { return std::isnan(known); });
  const std::size_t all = heights.size();
  sort_many(heights, for_each);
  const std::vector<double> levels = distinct_of_sorted(heights, kLevelGap * extent_of(rows));
  if (levels.size() <= 2 * kSpans || levels.size() * kHeightsOfLevel > all) return {};
  const std::optional<DisparityLaw> law = disparity_law(levels);
  std::vector<double> steps;
  for (std::size_t first = 0; law && first < rows.size(); first += row_size)
    steps.push_back(law->gap_at(height(rows[first])));
  return steps;
}

// The rows that are full.
std::vector<Point> known_rows(std::span<const Point> rows, std::size_t row_size) {
  std::vector<Point> known;
  for (std::size_t first = 0; first < rows.size(); first += row_size) {
    const auto row = rows.subspan(first, row_size);
    if (std::ranges::none_of(row, [](const Point& p) { return std::isnan(p.x); }))
      known.insert(known.end(), row.begin(), row.end());
  }
  return known;
}

}  // namespace

StepsInHeads steps_in_heads(std::span<const Point> heads, std::size_t samples, const ForEach& for_each) {
  const std::vector<Point> rows = known_rows(heads, kRow);
  const double rounding = kRounding * extent_of(rows);
  if (const double step = step_of_grid(rows, rounding); step > 0)
    return {{CoordinateSteps::Kind::grid, std::vector<double>(samples, step)}, std::nullopt, 0};
  return {{}, common_direction(rows, rounding, for_each), coarsest_step(rows, rounding)};
}

CoordinateSteps coordinate_steps(StepsInHeads in_heads, const NearestRows& nearest, const ForEach& for_each) {
  if (!in_heads.direction) return std::move(in_heads.steps);
  std::vector<double> steps =
      steps_along(*in_heads.direction, nearest.of(nearest.samples(), kLevelNeighbors), kLevelNeighbors + 1, for_each);
  return {steps.empty() ? CoordinateSteps::Kind::none : CoordinateSteps::Kind::depth, std::move(steps)};
}

}  // namespace pointfair
