// SPDX-License-Identifier: Apache-2.0
#include "estimate/noise_levels.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/node_grid.hpp"
#include "point/noise_field.h"

namespace pointfair {
namespace {

using namespace constants;

constexpr std::array kCounts{point::kLeastFit, point::kFirstFit, 2 * point::kFirstFit, point::kFirstRow};
constexpr std::size_t kSizes = kCounts.size();
using Curve = std::array<double, kSizes>;  // of variances over the sizes of neighbourhoods; NaN: not known
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Of a chi-squared variable of `freedom` over that, at kPoolQuantile (Wilson and Hilferty 1931).
double chance_quantile(double freedom) {
  const double part = 2 / (9 * freedom);
  return std::pow(1 - part + kPoolQuantileNormal * std::sqrt(part), 3);
}
double freedom_of(std::size_t size) { return kCounts[size] - point::kCubicTerms; }

// Neighbourhoods that are not wide against the noise do not show it.
Curve curve_of(const point::NoiseSample& noise, const point::ResidualSample* residuals) {
  Curve curve;
  curve.fill(kUnknown);
  if (!noise.is_wide) return curve;
  const double found[] = {residuals ? residuals->least : -1, residuals ? residuals->narrow : -1,
                          residuals ? residuals->wide : -1, residuals ? residuals->widest : -1};
  for (std::size_t size = 0; size < kSizes; ++size) {
    const double radius = noise.spacing * std::sqrt(kCounts[size] / std::numbers::pi);
    if (found[size] < 0 || radius < kWideRadius * noise.sigma) continue;
    curve[size] = found[size] * found[size];
  }
  return curve;
}

// The nearest of some places to each of them, found along x.
class Pools {
 public:
  explicit Pools(const std::vector<Point>& places) : places_(places), along_x_(places.size()) {
    std::iota(along_x_.begin(), along_x_.end(), std::uint32_t(0));
    std::sort(along_x_.begin(), along_x_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return places[a].x != places[b].x ? places[a].x < places[b].x : a < b;
    });
  }

  // Of the n-th place along x: that place first, into a row of kPool. Equal distances in the order of the places, which
  // is one of positions.
  void find(std::size_t n, std::uint32_t* row) const {
    std::array<std::pair<double, std::uint32_t>, kPool> nearest;
    nearest.fill({std::numeric_limits<double>::infinity(), 0});
    const Point& from = places_[along_x_[n]];
    // false: from here on all are too far
    const auto takes = [&](std::uint32_t j) {
      const Point& to = places_[j];
      const double x = double(from.x) - to.x, y = double(from.y) - to.y, z = double(from.z) - to.z;
      if (x * x > nearest.back().first) return false;
      const std::pair<double, std::uint32_t> found{x * x + y * y + z * z, j};
      if (!(found < nearest.back())) return true;
      std::size_t place = kPool - 1;
      for (; place > 0 && found < nearest[place - 1]; --place) nearest[place] = nearest[place - 1];
      nearest[place] = found;
      return true;
    };
    bool goes_up = true, goes_down = true;
    takes(along_x_[n]);
    for (std::size_t step = 1; goes_up || goes_down; ++step) {
      goes_up = goes_up && n + step < along_x_.size() && takes(along_x_[n + step]);
      goes_down = goes_down && step <= n && takes(along_x_[n - step]);
    }
    for (std::size_t i = 0; i < kPool; ++i) row[i] = nearest[i].second;
  }
  std::size_t place(std::size_t n) const { return along_x_[n]; }

 private:
  const std::vector<Point>& places_;
  std::vector<std::uint32_t> along_x_;
};

// At the place of the pool's first sample.
Curve pooled(std::span<const std::uint32_t> pool, const std::vector<Curve>& curves) {
  Curve result;
  std::vector<double> known;
  for (std::size_t size = 0; size < kSizes; ++size) {
    known.clear();
    for (const std::uint32_t i : pool)
      if (!std::isnan(curves[i][size])) known.push_back(curves[i][size]);
    result[size] = kUnknown;
    if (2 * known.size() < pool.size()) continue;
    const auto place = known.begin() + std::ptrdiff_t(std::lround(kPoolQuantile * double(known.size() - 1)));
    std::nth_element(known.begin(), place, known.end());
    result[size] = *place / chance_quantile(freedom_of(size));
  }
  return result;
}

// Of log(noise + shape) over the sizes, less log(noise): shape grows as a power of the size.
std::vector<Curve> models() {
  std::vector<Curve> rows;
  for (const double power : kShapePowers)
    for (int step = kLeastShape; step <= kMostShape; ++step) {
      Curve row;
      for (std::size_t size = 0; size < kSizes; ++size)
        row[size] = std::log1p(std::pow(10.0, step / 2.0) * std::pow(kCounts[size] / 16.0, power));
      rows.push_back(row);
    }
  return rows;
}

// The posterior mean of the standard deviation of the noise, over all models alike; the best noise of each is that of
// weighted least squares of logarithms.
double noise_of(const Curve& curve, const std::vector<Curve>& rows, double typical) {
  Curve weight{}, logs{};
  double all = 0;
  int known = 0;
  for (std::size_t size = 0; size < kSizes; ++size) {
    if (!(curve[size] > 0)) continue;
    const double chance = 2 / (freedom_of(size) * double(kPool) / 2);
    weight[size] = std::sqrt(16.0 / kCounts[size]) / (chance + kFitError * kFitError);
    logs[size] = std::log(curve[size]);
    all += weight[size];
    ++known;
  }
  const double prior = 1 / (4 * kSpread * kSpread), log_typical = 2 * std::log(typical);
  all += prior;
  if (known < 2) return kUnknown;               // nothing tells shape from noise
  std::vector<std::pair<double, double>> fits;  // minus twice the log likelihood, and log noise
  fits.reserve(rows.size());
  double best = std::numeric_limits<double>::infinity();
  for (const Curve& row : rows) {
    double first = prior * log_typical, second = prior * log_typical * log_typical;
    for (std::size_t size = 0; size < kSizes; ++size) {
      first += weight[size] * (logs[size] - row[size]);
      second += weight[size] * (logs[size] - row[size]) * (logs[size] - row[size]);
    }
    fits.emplace_back(second - first * first / all, first / all);
    best = std::min(best, fits.back().first);
  }
  double sum = 0, likelihood = 0;
  for (const auto& [misfit, log_noise] : fits) {
    if (misfit - best > kUnlikely) continue;
    const double its = std::exp(-0.5 * (misfit - best));
    sum += its * std::exp(0.5 * log_noise);
    likelihood += its;
  }
  return sum / likelihood;
}

// Of the noise at those places of a pool where it is known, or `otherwise`.
double median_known(std::span<const std::uint32_t> pool, const std::vector<double>& noise, double otherwise) {
  std::vector<double> known;
  for (const std::uint32_t i : pool)
    if (!std::isnan(noise[i])) known.push_back(noise[i]);
  if (known.empty()) return otherwise;
  const auto middle = known.begin() + std::ptrdiff_t(known.size() / 2);
  std::nth_element(known.begin(), middle, known.end());
  return *middle;
}

// Logarithms of levels, as far as they differ from 0 by more than chance makes them.
void shrink(std::vector<double>& log_levels) {
  double squares = 0;
  for (const double log_level : log_levels) squares += log_level * log_level;
  const double spread = squares / double(log_levels.size());
  const double share = spread > 0 ? std::max(0.0, 1 - kChanceOfLevels * kChanceOfLevels / spread) : 0;
  for (double& log_level : log_levels) log_level *= share;
}

}  // namespace

std::shared_ptr<const NoiseLevels> noise_levels(const LocalSamples& samples, double typical, const ForEach& for_each) {
  std::vector<Point> places;
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < samples.noise.size(); ++i) {
    if (!samples.noise[i].shows_noise) continue;
    places.push_back(samples.places[i]);
    curves.push_back(curve_of(samples.noise[i], samples.residuals.empty() ? nullptr : &samples.residuals[i]));
  }
  if (!(typical > 0) || places.size() < kFewestSamples) return nullptr;
  const std::vector<Curve> rows = models();
  std::vector<std::uint32_t> pools(places.size() * kPool);
  std::vector<double> noise(places.size()), log_levels(places.size());
  const Pools nearest(places);
  for_each(places.size(), [&](std::size_t n) {
    const std::size_t i = nearest.place(n);
    nearest.find(n, &pools[i * kPool]);
    noise[i] = noise_of(pooled(std::span(pools).subspan(i * kPool, kPool), curves), rows, typical);
  });
  for_each(places.size(), [&](std::size_t i) {
    const double median = median_known(std::span(pools).subspan(i * kPool, kSmoothed), noise, typical);
    log_levels[i] = std::log(std::clamp(median / typical, 1 / kLargestLevel, kLargestLevel));
  });
  shrink(log_levels);
  auto levels = std::make_shared<NoiseLevels>(levels_between(places, log_levels, for_each));
  levels->quantiles = quantiles_of(std::move(log_levels));
  return levels;
}

std::array<double, 3> quantiles_of(std::vector<double> log_levels) {
  std::array<double, 3> result{};
  std::sort(log_levels.begin(), log_levels.end());
  for (std::size_t q = 0; q < result.size(); ++q)
    result[q] = std::exp(log_levels[std::size_t(kToldQuantiles[q] * double(log_levels.size() - 1))]);
  return result;
}

}  // namespace pointfair
