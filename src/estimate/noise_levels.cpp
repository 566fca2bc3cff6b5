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

// Of a chi-squared variable of `freedom` over that (Wilson and Hilferty 1931).
double chance_median(double freedom) { return std::pow(1 - 2 / (9 * freedom), 3); }
double freedom_of(std::size_t size) { return kCounts[size] - point::kCubicTerms; }

const Curve& chance_medians() {
  static const Curve all = [] {
    Curve medians;
    for (std::size_t size = 0; size < kSizes; ++size) medians[size] = chance_median(freedom_of(size));
    return medians;
  }();
  return all;
}

// Neighbourhoods that are not wide against the noise do not show it.
Curve curve_of(const point::NoiseSample& noise, const point::ResidualSample* residuals) {
  Curve curve;
  curve.fill(kUnknown);
  if (!noise.is_wide) return curve;
  const double found[] = {residuals ? residuals->least : -1, residuals ? residuals->narrow : -1,
                          residuals ? residuals->wide : -1, residuals ? residuals->widest : -1};
  for (std::size_t size = 0; size < kSizes; ++size) {
    if (found[size] >= 0) curve[size] = found[size] * found[size];
  }
  return curve;
}

// Variances of each size of neighbourhood, at all places.
std::vector<Ranked> ranked(const std::vector<Curve>& curves) {
  std::vector<Ranked> result;
  for (std::size_t size = 0; size < kSizes; ++size) {
    std::vector<double> values;
    for (const Curve& curve : curves) values.push_back(curve[size]);
    result.emplace_back(values);
  }
  return result;
}

// The median of what is known in a pool, unknown where less than half is.
double middle(std::span<const std::uint32_t> pool, const Ranked& values) {
  return values.among(pool, [&](std::size_t known) { return 2 * known < pool.size() ? Ranked::kNoPlace : known / 2; });
}

// At the place of the pool's first sample.
Curve pooled(std::span<const std::uint32_t> pool, const std::vector<Ranked>& of_sizes) {
  Curve result;
  for (std::size_t size = 0; size < kSizes; ++size)
    result[size] = middle(pool, of_sizes[size]) / chance_medians()[size];
  return result;
}

// Narrow neighbourhoods cut off what lies far from the surface: there the noise is at least so large, and unknown where
// it is larger elsewhere.
Curve without_cut_off(Curve curve, double spacing, double typical) {
  for (std::size_t size = 0; size < kSizes; ++size) {
    const double residual = std::sqrt(curve[size]), radius = spacing * std::sqrt(kCounts[size] / std::numbers::pi);
    if (residual < typical && radius < kWideAgainstResiduals * residual) curve[size] = kUnknown;
  }
  return curve;
}

// Of log(noise + shape) over the sizes, less log(noise): shape grows as a power of the size. An array a size.
constexpr std::size_t kSteps = kMostShape - kLeastShape + 1, kModels = kShapePowers.size() * kSteps;
using Models = std::array<std::array<double, kModels>, kSizes>;

const Models& models() {
  static const Models all = [] {
    Models rows;
    for (std::size_t n = 0; n < kModels; ++n)
      for (std::size_t size = 0; size < kSizes; ++size) {
        const int step = kLeastShape + int(n % kSteps);
        rows[size][n] =
            std::log1p(std::pow(10.0, step / 2.0) * std::pow(kCounts[size] / 16.0, kShapePowers[n / kSteps]));
      }
    return rows;
  }();
  return all;
}

// Of a variance over so many points among those of all sizes.
const Curve& size_weights() {
  static const Curve all = [] {
    Curve weights;
    for (std::size_t size = 0; size < kSizes; ++size) {
      const double chance = 2 / (freedom_of(size) * double(kPool) / 2);
      weights[size] = std::sqrt(16.0 / kCounts[size]) / (chance + kFitError * kFitError);
    }
    return weights;
  }();
  return all;
}

// The posterior mean of the standard deviation of the noise, over all models alike; the best noise of each is that of
// weighted least squares of logarithms.
double noise_of(const Curve& curve, double typical) {
  Curve weight{}, logs{};
  double all = 0;
  int known = 0;
  for (std::size_t size = 0; size < kSizes; ++size) {
    if (!(curve[size] > 0)) continue;
    weight[size] = size_weights()[size];
    logs[size] = std::log(curve[size]);
    all += weight[size];
    ++known;
  }
  if (known < 2) return kUnknown;  // nothing tells shape from noise
  const double prior = 1 / (4 * kSpread * kSpread), log_typical = 2 * std::log(typical);
  all += prior;
  const Models& rows = models();
  std::array<double, kModels> misfit, log_noise;  // minus twice the log likelihood
  for (std::size_t n = 0; n < kModels; ++n) {
    double first = prior * log_typical, second = prior * log_typical * log_typical;
    for (std::size_t size = 0; size < kSizes; ++size) {
      const double part = logs[size] - rows[size][n];
      first += weight[size] * part;
      second += weight[size] * part * part;
    }
    misfit[n] = second - first * first / all;
    log_noise[n] = first / all;
  }
  const double best = *std::min_element(misfit.begin(), misfit.end());
  double sum = 0, likelihood = 0;
  for (std::size_t n = 0; n < kModels; ++n) {
    if (misfit[n] - best > kUnlikely) continue;
    const double its = std::exp(-0.5 * (misfit[n] - best));
    sum += its * std::exp(0.5 * log_noise[n]);
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
  const std::vector<Ranked> of_sizes = ranked(curves);
  std::vector<double> noise(samples.places.size()), log_levels(noise.size());
  for (std::size_t i = 0; i < noise.size(); ++i)
    noise[i] = samples.noise[i].is_wide ? samples.noise[i].spacing : kUnknown;
  const Ranked spacings(noise);
  for_each(noise.size(), [&](std::size_t i) {
    const Curve curve = without_cut_off(pooled(pools.of(i), of_sizes), middle(pools.of(i), spacings), typical);
    noise[i] = noise_of(curve, typical);
  });
  const Ranked noises(noise);
  for_each(noise.size(), [&](std::size_t i) {
    const double median = median_known(pools.of(i).first(kSmoothed), noises).value_or(typical);
    log_levels[i] = std::log(std::clamp(median / typical, 1 / kLargestLevel, kLargestLevel));
  });
  shrink(log_levels);
  const auto levels = shared(NoiseLevels{levels_between(samples.places, log_levels, for_each)});
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = typical * std::exp(log_levels[i]);
  levels->quantiles = quantiles_of(std::move(log_levels));
  return {std::move(noise), levels};
}

std::array<double, 3> quantiles_of(std::vector<double> log_levels) {
  std::array<double, 3> result{};
  std::sort(log_levels.begin(), log_levels.end());
  for (std::size_t q = 0; q < result.size(); ++q)
    result[q] = std::exp(log_levels[std::size_t(kToldQuantiles[q] * double(log_levels.size() - 1))]);
  return result;
}

}  // namespace pointfair
