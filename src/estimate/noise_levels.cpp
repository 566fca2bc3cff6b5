// SPDX-License-Identifier: Apache-2.0
#include "estimate/noise_levels.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/node_grid.hpp"
#include "estimate/quantile.hpp"
#include "portable.hpp"
#include "seam/sample_fits.hpp"

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

// What a sample shows whose neighbourhood is wide against the noise; NaN of the others, which show no noise.
struct Shown {
  Curve variances;
  double spacing;
};

std::vector<Shown> shown_by(const LocalSamples& samples) {
  Shown nothing{{}, kUnknown};
  nothing.variances.fill(kUnknown);
  std::vector<Shown> shown(samples.places.size(), nothing);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    if (!samples.noise[i].is_wide) continue;
    shown[i].spacing = samples.noise[i].spacing;
    if (samples.noise[i].gap > 0) {  // smaller and larger neighbourhoods may take two sheets for one
      for (std::size_t size = 0; size < kSizes; ++size)
        shown[i].variances[size] = samples.noise[i].sigma * samples.noise[i].sigma * chance_medians()[size];
      continue;
    }
    const point::ResidualSample& its = samples.residuals[i];
    const double found[] = {its.least, its.narrow, its.wide, its.widest};
    for (std::size_t size = 0; size < kSizes; ++size)
      if (found[size] >= 0) shown[i].variances[size] = found[size] * found[size];
  }
  return shown;
}

// The comparisons of Batcher's odd-even merge sort of a pool.
constexpr auto kNetwork = [] {
  static_assert(kPool == 16);
  std::array<std::pair<unsigned char, unsigned char>, 63> network;
  std::size_t count = 0;
  for (std::size_t sorted = 1; sorted < kPool; sorted *= 2)
    for (std::size_t apart = sorted; apart > 0; apart /= 2)
      for (std::size_t low = apart % sorted; low + apart < kPool; ++low) {
        const bool is_in_pair = (low - apart % sorted) / apart % 2 == 0;
        if (is_in_pair && low / (2 * sorted) == (low + apart) / (2 * sorted))
          network[count++] = {static_cast<unsigned char>(low), static_cast<unsigned char>(low + apart)};
      }
  return network;
}();

// The medians over a pool of what is known of each value, NaN where fewer than half are. All at once, and without
// branches that depend on values, which are hard to guess.
Shown medians_of(std::span<const std::uint32_t> pool, const std::vector<Shown>& shown) {
  constexpr std::size_t kValues = kSizes + 2;  // the spacing twice, since vectors hold two values
  using Values = std::array<double, kValues>;
  std::array<Values, kPool> sorted;
  std::array<std::size_t, kValues> known{};
  for (std::size_t i = 0; i < kPool; ++i) {
    const Shown& its = shown[pool[i]];
    std::ranges::copy(its.variances, sorted[i].begin());
    sorted[i][kSizes] = sorted[i][kSizes + 1] = its.spacing;
    for (std::size_t v = 0; v < kValues; ++v) {
      const bool is_known = sorted[i][v] == sorted[i][v];
      known[v] += is_known;
      sorted[i][v] = is_known ? sorted[i][v] : std::numeric_limits<double>::infinity();
    }
  }
  for (const auto& [low, high] : kNetwork) {
    const Values a = sorted[low], b = sorted[high];
    for (std::size_t v = 0; v < kValues; ++v) sorted[low][v] = std::min(a[v], b[v]);
    for (std::size_t v = 0; v < kValues; ++v) sorted[high][v] = std::max(a[v], b[v]);
  }
  const auto median = [&](std::size_t v) { return 2 * known[v] >= kPool ? sorted[known[v] / 2][v] : kUnknown; };
  Shown medians;
  for (std::size_t size = 0; size < kSizes; ++size) medians.variances[size] = median(size);
  medians.spacing = median(kSizes);
  return medians;
}

// The variances at the place of the pool's first sample. A narrow neighbourhood cuts off what lies far from the
// surface, so its variance is a lower bound. One that is below the typical noise is therefore unknown.
Curve curve_of(std::span<const std::uint32_t> pool, const std::vector<Shown>& shown, double typical) {
  const Shown medians = medians_of(pool, shown);
  Curve curve;
  curve.fill(kUnknown);
  for (std::size_t size = 0; size < kSizes; ++size) {
    const double variance = medians.variances[size] / chance_medians()[size];
    const double radius = medians.spacing * std::sqrt(kCounts[size] / std::numbers::pi);
    const bool cut_off = variance < typical * typical && radius < kWideAgainstResiduals * std::sqrt(variance);
    if (!cut_off) curve[size] = variance;
  }
  return curve;
}

constexpr std::size_t kSteps = kMostShape - kLeastShape + 1, kModels = kShapePowers.size() * kSteps;
static_assert(kModels <= CurveModels::kMost && kSizes == CurveModels::kValues);
using OfModels = std::array<double, kModels>;

const double kPriorWeight = 1 / (4 * kSpread * kSpread);  // of the typical noise

// What all weighted least squares of Eq. 21 share whose variances are known at the same sizes.
struct Fit {
  Curve weight{};             // of each size's variance; 0 where it is not known
  double all = kPriorWeight;  // weights
  OfModels misfit;            // minus twice the log likelihood of a curve that is 1 everywhere
  OfModels noise;             // over that of a model without shape
};

struct Models {
  std::array<OfModels, kSizes> logs;    // log(1 + shape / noise) at each size: shape grows as a power of the size
  std::array<Fit, 1 << kSizes> fit_of;  // by the known sizes, a bit each
};

const Models& models() {
  static const Models all = [] {
    Models its;
    for (std::size_t n = 0; n < kModels; ++n)
      for (std::size_t size = 0; size < kSizes; ++size) {
        const int step = kLeastShape + int(n % kSteps);
        its.logs[size][n] = portable::log1p(portable::pow(10.0, step / 2.0) *
                                            portable::pow(kCounts[size] / 16.0, kShapePowers[n / kSteps]));
      }
    for (std::size_t known = 0; known < its.fit_of.size(); ++known) {
      Fit& fit = its.fit_of[known];
      for (std::size_t size = 0; size < kSizes; ++size) {
        if (!(known >> size & 1)) continue;
        const double chance = 2 / (freedom_of(size) * double(kPool) / 2);
        fit.weight[size] = std::sqrt(16.0 / kCounts[size]) / (chance + kFitError * kFitError);
        fit.all += fit.weight[size];
      }
      for (std::size_t n = 0; n < kModels; ++n) {
        double first = 0, second = 0;
        for (std::size_t size = 0; size < kSizes; ++size) {
          first += fit.weight[size] * its.logs[size][n];
          second += fit.weight[size] * its.logs[size][n] * its.logs[size][n];
        }
        fit.misfit[n] = second - first * first / fit.all;
        fit.noise[n] = portable::exp(-0.5 * first / fit.all);
      }
    }
    return its;
  }();
  return all;
}

// The posterior mean of the standard deviation of the noise, over all models with one prior; the noise of each model is
// that of weighted least squares of logarithms.
double noise_of(const Curve& curve, double log_typical) {
  Curve logs{};
  std::size_t known = 0;
  for (std::size_t size = 0; size < kSizes; ++size) {
    if (!(curve[size] > 0)) continue;
    logs[size] = portable::log(curve[size]);
    known |= std::size_t(1) << size;
  }
  if (std::popcount(known) < 2) return kUnknown;  // nothing tells shape from noise
  const Fit& fit = models().fit_of[known];
  double mean = kPriorWeight * 2 * log_typical / fit.all;
  for (std::size_t size = 0; size < kSizes; ++size) mean += fit.weight[size] * logs[size] / fit.all;
  Curve pull;  // of each size on the misfit
  for (std::size_t size = 0; size < kSizes; ++size) pull[size] = 2 * fit.weight[size] * (logs[size] - mean);
  const std::array<OfModels, kSizes>& rows = models().logs;
  const CurveModels curves{
      kModels, fit.misfit.data(), {rows[0].data(), rows[1].data(), rows[2].data(), rows[3].data()}, fit.noise.data()};
  return portable::exp(0.5 * mean) * sample_fits().mean_said(curves, pull.data());
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

LocalNoise local_noise(const LocalSamples& samples, double typical, double most, const ForEach& for_each) {
  const std::vector<Shown> shown = shown_by(samples);
  const double log_cloud = portable::log(typical);
  std::vector<double> noise(samples.places.size()), log_levels(noise.size());
  for_places(noise.size(), for_each,
             [&](std::size_t i) { noise[i] = noise_of(curve_of(samples.pool(i), shown, typical), log_cloud); });
  for_places(noise.size(), for_each, [&](std::size_t i) {
    const double median = median_known(samples.near(i), noise);
    log_levels[i] = std::isnan(median) ? 0 : portable::log(std::min(median, most) / typical);
  });
  shrink(log_levels);
  const double log_typical = quantile(log_levels, 0.5);
  const double largest = portable::log(kLargestLevel);
  typical *= portable::exp(log_typical);
  for_places(noise.size(), for_each, [&](std::size_t i) {
    log_levels[i] = std::clamp(log_levels[i] - log_typical, -largest, largest);
    noise[i] = typical * portable::exp(log_levels[i]);
  });
  return {typical, std::move(noise), std::move(log_levels)};
}

std::shared_ptr<const NoiseLevels> noise_levels(NodeLevels levels, const std::vector<double>& log_levels) {
  return std::make_shared<const NoiseLevels>(NoiseLevels{std::move(levels), quantiles_of(log_levels)});
}

std::shared_ptr<const NoiseLevels> noise_levels(const std::vector<Point>& places, std::vector<double> log_levels,
                                                const ForEach& for_each) {
  const std::vector<std::vector<double>> fields{std::move(log_levels)};
  return noise_levels(std::move(levels_between(places, fields, for_each).front()), fields.front());
}

}  // namespace pointfair
