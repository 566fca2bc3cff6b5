// SPDX-License-Identifier: Apache-2.0
#include "estimate/coordinate_steps.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "point/sample.h"

namespace pointfair {
namespace {

using point::Offset;

constexpr std::size_t kRow = kStepNeighbors + 1;
constexpr double kRounding = 2.4e-7;  // of the extent: 4 units in the last place of single precision
constexpr std::size_t kRepeats = 20;  // so often, on average, values recur that have steps
constexpr std::size_t kGlance = 256;  // values; fewer than half of them are distinct
constexpr double kSameStep = 0.05;    // relative
constexpr std::size_t kFewestLevels = 3;
constexpr double kExactPlane = 1e-4;  // of its neighbourhood's size
constexpr double kRoundness = 0.05;   // of eigenvalues in the plane; less is a line
constexpr std::size_t kFewestPlanes = 10, kMostPlanes = 400;
constexpr double kSameDirection = 0.99985;  // cosine of 1 degree
constexpr double kLevelGap = 2e-6;          // of the extent; heights are not nearer
constexpr std::size_t kHeightsOfLevel = 8;  // so many, on average

double coordinate(const Point& p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }
bool is_known(std::span<const Point> row) {
  return std::none_of(row.begin(), row.end(), [](const Point& p) { return std::isnan(p.x); });
}

// Values that lie `apart`, of many sorted ones.
std::vector<double> distinct(std::vector<double> values, double apart) {
  std::sort(values.begin(), values.end());
  std::vector<double> result;
  double last = 0;
  for (const double value : values) {
    if (result.empty() || value - last > apart) result.push_back(value);
    last = value;
  }
  return result;
}

// Along one axis, from differences between neighbours; 0 where there is none.
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
  const auto middle = gaps.begin() + std::ptrdiff_t(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  const double step = *middle;
  const auto alike =
      std::count_if(gaps.begin(), gaps.end(), [step](double gap) { return std::abs(gap - step) < kSameStep * step; });
  return 2 * std::size_t(alike) > gaps.size() && rounding < kSameStep * step ? step : 0;
}

// A flat cloud of rows and columns has steps along two axes, and no noise for it.
double step_of_grid(std::span<const Point> rows, double rounding) {
  const double step = grid_step(rows, 0, rounding);
  for (int axis = 1; axis < 3 && step > 0; ++axis)
    if (std::abs(grid_step(rows, axis, rounding) - step) > kSameStep * step) return 0;
  return step;
}

using Matrix = point::Sym3<double>;
Matrix sum(const Matrix& a, const Matrix& b) {
  return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
}

struct ExactPlane {
  Offset normal;
  Matrix moments;  // second ones, about the centroid
};

// Of a row that lies on one, and not along a line.
std::optional<ExactPlane> exact_plane(std::span<const Point> row, double rounding) {
  std::array<Offset, kRow> offsets;
  Offset centroid{};
  for (std::size_t i = 0; i < kRow; ++i) {
    offsets[i] = point::offset_between(row[0], row[i]);
    centroid = centroid + (1.0 / double(kRow)) * offsets[i];
  }
  Matrix m{};
  double farthest = 0;
  for (Offset& o : offsets) {
    o = o - centroid;
    m = sum(m, {o.x * o.x, o.x * o.y, o.x * o.z, o.y * o.y, o.y * o.z, o.z * o.z});
    farthest = std::max(farthest, point::length(o));
  }
  const auto normal = point::least_eigenvector(m);
  if (!normal.exists) return std::nullopt;
  for (const Offset& o : offsets)
    if (std::abs(point::dot(o, normal.unit)) > std::max(kExactPlane * farthest, rounding)) return std::nullopt;
  // of the two eigenvalues in the plane: their sum and, by the principal minors, their product
  const double trace = m.xx + m.yy + m.zz;
  const double minors = m.xx * m.yy - m.xy * m.xy + m.xx * m.zz - m.xz * m.xz + m.yy * m.zz - m.yz * m.yz;
  if (minors < kRoundness * (trace * trace - 2 * minors)) return std::nullopt;
  return ExactPlane{normal.unit, m};
}

// Along which most exact planes face, or nothing where there are few.
std::optional<Offset> common_direction(std::span<const Point> rows, double rounding) {
  std::vector<ExactPlane> planes;
  for (std::size_t first = 0; first < rows.size() && planes.size() < kMostPlanes; first += kRow)
    if (const auto plane = exact_plane(rows.subspan(first, kRow), rounding)) planes.push_back(*plane);
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
  Matrix moments{};
  for (std::size_t j = 0; j < planes.size(); ++j)
    if (is_alike(commonest, j)) moments = sum(moments, planes[j].moments);
  return point::least_eigenvector(moments).unit;
}

// At each row's first point, along a direction; empty where heights have no levels.
std::vector<double> steps_along(Offset direction, std::span<const Point> rows, double extent) {
  std::vector<double> heights;
  for (const Point& p : rows) heights.push_back(point::dot(point::offset_between(rows[0], p), direction));
  const double apart = kLevelGap * extent;
  const std::vector<double> levels = distinct(heights, apart);
  if (levels.size() < kFewestLevels || levels.size() * kHeightsOfLevel > heights.size()) return {};
  std::vector<double> steps;
  for (std::size_t first = 0; first < rows.size(); first += kRow) {
    const auto next = std::upper_bound(levels.begin(), levels.end(), heights[first] + apart / 2);
    const std::size_t level = std::size_t(std::max<std::ptrdiff_t>(next - levels.begin() - 1, 0));
    // levels may be missing on one side
    double step = level > 0 ? levels[level] - levels[level - 1] : levels[1] - levels[0];
    if (level + 1 < levels.size()) step = std::min(step, levels[level + 1] - levels[level]);
    steps.push_back(step);
  }
  return steps;
}

}  // namespace

CoordinateSteps coordinate_steps(std::span<const Point> all) {
  std::vector<Point> rows;
  std::vector<std::size_t> row_of(all.size() / kRow, all.size());
  double extent = 0;
  for (std::size_t first = 0; first < all.size(); first += kRow) {
    const auto row = all.subspan(first, kRow);
    if (!is_known(row)) continue;
    row_of[first / kRow] = rows.size() / kRow;
    rows.insert(rows.end(), row.begin(), row.end());
    for (const Point& p : row)
      for (int axis = 0; axis < 3; ++axis)
        extent = std::max(extent, std::abs(coordinate(p, axis) - coordinate(rows[0], axis)));
  }
  CoordinateSteps result;
  std::vector<double> steps;
  const double rounding = kRounding * extent;
  if (const double step = step_of_grid(rows, rounding); step > 0) {
    result.kind = CoordinateSteps::Kind::grid;
    steps.assign(rows.size() / kRow, step);
  } else if (const auto direction = common_direction(rows, rounding)) {
    steps = steps_along(*direction, rows, extent);
    if (!steps.empty()) result.kind = CoordinateSteps::Kind::depth;
  }
  if (result.kind == CoordinateSteps::Kind::none) return result;
  for (const std::size_t row : row_of) result.at.push_back(row < steps.size() ? steps[row] : 0);
  return result;
}

}  // namespace pointfair
