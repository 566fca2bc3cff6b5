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
#include "estimate/quantile.hpp"
#include "portable.hpp"

namespace pointfair {
namespace {

using namespace constants;

// Points of the neighbourhoods that samples have residuals of.
constexpr std::array kCounts{point::kLeastFit, point::kFirstFit, 2 * point::kFirstFit, point::kFirstRow};
constexpr std::size_t kSizes = kCounts.size();
using Curve = std::array<double, kSizes>;  // of variances over the sizes of neighbourhoods; NaN: not known
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// The median of a chi-squared variable of `freedom` degrees, divided by them (Wilson and Hilferty 1931).
double chance_median(double freedom) {
  const double root = 1 - 2 / (9 * freedom);
  return root * root * root;
}
double freedom_of(std::size_t size) { return kCounts[size] - point::kCubicTerms; }

const Curve& chance_medians() {
  static const Curve all = [] {
    Curve medians;
    for (std::size_t size = 0; size < kSizes; ++size) medians[size] = chance_median(freedom_of(size));
    return medians;
  }();
  return all;
}

// What the samples show whose neighbourhood is wide against the noise; NaN of the others, which show no noise.
struct Shown {
  std::array<std::vector<double>, kSizes> variances;  // of each size of neighbourhood
  std::vector<double> spacings;                       // of the wide neighbourhoods
};

Shown shown_by(const LocalSamples& samples) {
  const std::size_t count = samples.places.size();
  Shown shown;
  shown.spacings.assign(count, kUnknown);
  shown.variances.fill(shown.spacings);
  for (std::size_t i = 0; i < count; ++i) {
    if (!samples.noise[i].is_wide) continue;
    shown.spacings[i] = samples.noise[i].spacing;
    const point::ResidualSample& its = samples.residuals[i];
    const double found[] = {its.least, its.narrow, its.wide, its.widest};
    for (std::size_t size = 0; size < kSizes; ++size)
      if (found[size] >= 0) shown.variances[size][i] = found[size] * found[size];
  }
  return shown;
}

// The variances at the place of the pool's first sample. A narrow neighbourhood cuts off what lies far from the
// surface, so its variance is a lower bound. One that is below the typical noise is therefore unknown.
Curve curve_of(std::span<const std::uint32_t> pool, const Shown& shown, double typical) {
  const std::size_t half = (pool.size() + 1) / 2;  // as many must be known
  const double spacing = median_known(pool, shown.spacings, half);
  Curve curve;
  curve.fill(kUnknown);
  for (std::size_t size = 0; size < kSizes; ++size) {
    const double variance = median_known(pool, shown.variances[size], half) / chance_medians()[size];
    const double radius = spacing * std::sqrt(kCounts[size] / std::numbers::pi);
    const bool cut_off = variance < typical * typical && radius < kWideAgainstResiduals * std::sqrt(variance);
    if (!cut_off) curve[size] = variance;
  }
  return curve;
}

// log(1 + shape / noise) of each model (Eq. 21), for each size: shape grows as a power of the size.
constexpr std::size_t kSteps = kMostShape - kLeastShape + 1, kModels = kShapePowers.size() * kSteps;
using Models = std::array<std::array<double, kModels>, kSizes>;

const Models& models() {
  static const Models all = [] {
    Models rows;
    for (std::size_t n = 0; n < kModels; ++n)
      for (std::size_t size = 0; size < kSizes; ++size) {
        const int step = kLeastShape + int(n % kSteps);
        rows[size][n] = portable::log1p(portable::pow(10.0, step / 2.0) *
                                        portable::pow(kCounts[size] / 16.0, kShapePowers[n / kSteps]));
      }
    return rows;
  }();
  return all;
}

// The weight of a size's variance in the fits of Eq. 21.
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

// The posterior mean of the standard deviation of the noise, over all models with one prior; the noise of each model is
// that of weighted least squares of logarithms.
double noise_of(const Curve& curve, double typical) {
  Curve weight{}, logs{};
  double all = 0;
  int known = 0;
  for (std::size_t size = 0; size < kSizes; ++size) {
    if (!(curve[size] > 0)) continue;
    weight[size] = size_weights()[size];
    logs[size] = portable::log(curve[size]);
    all += weight[size];
    ++known;
  }
  if (known < 2) return kUnknown;  // nothing tells shape from noise
  const double prior = 1 / (4 * kSpread * kSpread), log_typical = 2 * portable::log(typical);
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
  // one thing a loop, so that compilers make vectors of each
  constexpr double kNextToNone = -690;  // its exponential is lost beside the best one's, which is 1
  std::array<double, kModels> likelihood, noise;
  for (std::size_t n = 0; n < kModels; ++n) likelihood[n] = std::max(-0.5 * (misfit[n] - best), kNextToNone);
  for (double& its : likelihood) its = portable::exp_within_700(its);
  for (std::size_t n = 0; n < kModels; ++n) noise[n] = portable::exp_within_700(0.5 * log_noise[n]);
  double sum = 0, all_likelihoods = 0;
  for (std::size_t n = 0; n < kModels; ++n) {
    sum += likelihood[n] * noise[n];
    all_likelihoods += likelihood[n];
  }
  return sum / all_likelihoods;
}

// Shrinks the logarithms of levels by the share of their spread that chance makes.
void shrink(std::vector<double>& log_levels) {
  double squares = 0;
  for (const double log_level : log_levels) squares += log_level * log_level;
  const double spread = squares / double(log_levels.size());
  const double share = spread > 0 ? std::max(0.0, 1 - kChanceOfLevels * kChanceOfLevels / spread) : 0;
  for (double& log_level : log_levels) log_level *= share;
}

// At 5, 50 and 95 % of the places.
std::array<double, 3> quantiles_of(const std::vector<double>& log_levels) {
  std::array<double, 3> result{};
  for (std::size_t q = 0; q < result.size(); ++q)
    result[q] = portable::exp(quantile(log_levels, kReportedQuantiles[q]));
  return result;
}

}  // namespace

LocalNoise local_noise(const LocalSamples& samples, double typical, const ForEach& for_each) {
  const Shown shown = shown_by(samples);
  std::vector<double> noise(samples.places.size()), log_levels(noise.size());
  for_each(noise.size(),
           [&](std::size_t i) { noise[i] = noise_of(curve_of(samples.pool(i), shown, typical), typical); });
  for_each(noise.size(), [&](std::size_t i) {
    const double median = median_known(samples.near(i), noise);
    log_levels[i] = std::isnan(median) ? 0 : portable::log(median / typical);
  });
  shrink(log_levels);
  const double log_typical = quantile(log_levels, 0.5);
  const double largest = portable::log(kLargestLevel);
  for (double& log_level : log_levels) log_level = std::clamp(log_level - log_typical, -largest, largest);
  typical *= portable::exp(log_typical);
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = typical * portable::exp(log_levels[i]);
  return {typical, std::move(noise), std::move(log_levels)};
}

std::shared_ptr<const NoiseLevels> noise_levels(const std::vector<Point>& places, const std::vector<double>& log_levels,
                                                const ForEach& for_each) {
  return std::make_shared<const NoiseLevels>(
      NoiseLevels{levels_between(places, log_levels, for_each), quantiles_of(log_levels)});
}

}  // namespace pointfair
