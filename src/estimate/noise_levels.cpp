// SPDX-License-Identifier: Apache-2.0
#include "estimate/noise_levels.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/node_grid.hpp"

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

// Logarithms of levels, as far as they differ from 0 by more than chance makes them.
void shrink(std::vector<double>& log_levels) {
  double squares = 0;
  for (const double log_level : log_levels) squares += log_level * log_level;
  const double spread = squares / double(log_levels.size());
  const double share = spread > 0 ? std::max(0.0, 1 - kChanceOfLevels * kChanceOfLevels / spread) : 0;
  for (double& log_level : log_levels) log_level *= share;
}

}  // namespace

LocalNoise local_noise(const LocalSamples& samples, double typical, const Pools& pools, const ForEach& for_each) {
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < samples.places.size(); ++i)
    curves.push_back(curve_of(samples.noise[i], samples.residuals.empty() ? nullptr : &samples.residuals[i]));
  const std::vector<Curve> rows = models();
  std::vector<double> noise(samples.places.size()), log_levels(noise.size());
  for_each(noise.size(), [&](std::size_t i) { noise[i] = noise_of(pooled(pools.of(i), curves), rows, typical); });
  for_each(noise.size(), [&](std::size_t i) {
    const double median = median_known(pools.of(i).first(kSmoothed), noise).value_or(typical);
    log_levels[i] = std::log(std::clamp(median / typical, 1 / kLargestLevel, kLargestLevel));
  });
  shrink(log_levels);
  auto levels = std::make_shared<NoiseLevels>(NoiseLevels{levels_between(samples.places, log_levels, for_each)});
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = typical * std::exp(log_levels[i]);
  levels->quantiles = quantiles_of(std::move(log_levels));
  return {std::move(noise), std::move(levels)};
}

std::array<double, 3> quantiles_of(std::vector<double> log_levels) {
  std::array<double, 3> result{};
  std::sort(log_levels.begin(), log_levels.end());
  for (std::size_t q = 0; q < result.size(); ++q)
    result[q] = std::exp(log_levels[std::size_t(kToldQuantiles[q] * double(log_levels.size() - 1))]);
  return result;
}

}  // namespace pointfair
