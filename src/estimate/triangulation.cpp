// SPDX-License-Identifier: Apache-2.0
#include "estimate/triangulation.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"
#include "portable.hpp"

namespace pointfair {
namespace {

using namespace constants;

// Logarithms, of one sample.
struct Pair {
  double step, residual;
};

// From samples to their nearest others, one after the other; 0 where there are none.
struct Steps {
  double first = 0, second = 0;
};

std::vector<Steps> steps_of(const NearestRows& nearest) {
  constexpr std::size_t kRow = kStepNeighbors + 1;
  const std::vector<Point>& heads = nearest.heads();
  std::vector<Steps> steps;
  for (std::size_t i = 0; i + kRow <= heads.size(); i += kRow) {
    const auto distance = [&](const Point& there) {
      const Point& here = heads[i];
      const double far = portable::hypot(double{here.x} - there.x, double{here.y} - there.y, double{here.z} - there.z);
      return std::isfinite(far) ? far : 0;
    };
    steps.push_back({distance(heads[i + 1]), distance(heads[i + 2])});
  }
  return steps;
}

// Whether points lie on a grid of pixels: the two nearest are on both sides, equally far. By chance they are not.
bool are_pixels(const std::vector<Steps>& steps) {
  std::vector<double> ratios;
  for (const Steps& of : steps)
    if (of.second > 0) ratios.push_back(of.first > 0 ? of.second / of.first : kEndless);
  return !ratios.empty() && quantile(ratios, 0.9) < kMostUneven;
}

// Where a surface is slanted, only the nearest points are one step of the rays away.
std::vector<Pair> pairs_of(std::span<const point::ResidualSample> samples, const std::vector<Steps>& steps) {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < std::min(samples.size(), steps.size()); ++i)
    if (steps[i].second > 0 && samples[i].narrow > 0)
      pairs.push_back({portable::log(steps[i].second), portable::log(samples[i].narrow)});
  return pairs;
}

// Of the quieter half, if residuals are divided by this power of the step.
double spread(const std::vector<Pair>& pairs, double power) {
  std::vector<double> values;
  for (const Pair& pair : pairs) values.push_back(pair.residual - power * pair.step);
  return quantile(values, 0.5) - quantile(values, 0.1);
}

// Of a line through the quieter residuals of groups of equal size, by their steps: the power.
double slope(std::vector<Pair> pairs) {
  std::ranges::sort(
      pairs, [](const Pair& a, const Pair& b) { return a.step != b.step ? a.step < b.step : a.residual < b.residual; });
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t group = 0; group < kStepGroups; ++group) {
    const std::size_t first = group * pairs.size() / kStepGroups, end = (group + 1) * pairs.size() / kStepGroups;
    std::vector<double> residuals;
    for (std::size_t i = first; i < end; ++i) residuals.push_back(pairs[i].residual);
    const double step = pairs[(first + end) / 2].step - pairs.front().step, residual = quantile(residuals, 0.25);
    n += 1;
    x += step;
    y += residual;
    xx += step * step;
    xy += step * residual;
  }
  const double across = n * xx - x * x;
  return across > 0 ? (n * xy - x * y) / across : 0;
}

}  // namespace

bool errs_by_triangulation(std::span<const point::ResidualSample> samples, const NearestRows& nearest) {
  const std::vector<Steps> nearest_steps = steps_of(nearest);
  const std::vector<Pair> pairs = pairs_of(samples, nearest_steps);
  if (pairs.size() < kLeastSamples || !are_pixels(nearest_steps)) return false;
  std::vector<double> steps;
  for (const Pair& pair : pairs) steps.push_back(pair.step);
  if (quantile(steps, 0.9) - quantile(steps, 0.1) < kLeastStepRange) return false;
  const double power = slope(pairs);
  return power > kSquareOfSteps[0] && power < kSquareOfSteps[1] &&
         spread(pairs, 2) < kMostSpreadOfSquare * spread(pairs, 0);
}

}  // namespace pointfair
