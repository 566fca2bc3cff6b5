// SPDX-License-Identifier: Apache-2.0
#include "estimate/noise_levels.hpp"

#include <algorithm>
#include <array>
#include <bit>
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
constexpr std::size_t kAtOnce = 32;        // places that one core takes
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Of a chi-squared variable of `freedom` over that, at kPoolQuantile (Wilson and Hilferty 1931).
double chance_quantile(double freedom) {
  const double part = 2 / (9 * freedom);
  return std::pow(1 - part + kPoolQuantileNormal * std::sqrt(part), 3);
}
double freedom_of(std::size_t size) { return kCounts[size] - point::kCubicTerms; }
const Curve& chance_quantiles() {
  static const Curve all = [] {
    Curve quantiles;
    for (std::size_t size = 0; size < kSizes; ++size) quantiles[size] = chance_quantile(freedom_of(size));
    return quantiles;
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
    for (const std::uint32_t i : along_x_) {
      x_.push_back(places[i].x);
      y_.push_back(places[i].y);
      z_.push_back(places[i].z);
    }
  }

  // Of the n-th places along x from `begin` to before `end`: rows of kPool, each at that place in `rows`, the kSmoothed
  // nearest first. Equal distances in the order of the places, which is one of positions.
  void find(std::size_t begin, std::size_t end, std::uint32_t* rows) const {
    std::vector<Found> found(places_.size());
    double guess = std::numeric_limits<double>::infinity();  // most rows reach about as far as the one before
    for (std::size_t n = begin; n < end; ++n) {
      std::size_t count = collect(n, guess, found);
      while (count < kPool) count = collect(n, guess *= 4, found);
      const auto first = found.begin();
      std::nth_element(first, first + kPool - 1, first + std::ptrdiff_t(count));
      guess = 1.5 * first[kPool - 1].first;
      if (!(guess > 0)) guess = std::numeric_limits<double>::infinity();
      std::nth_element(first, first + kSmoothed, first + kPool);
      for (std::size_t i = 0; i < kPool; ++i) rows[along_x_[n] * kPool + i] = first[i].second;
    }
  }

 private:
  using Found = std::pair<double, std::uint32_t>;  // squared distance, and whose

  // All within a squared radius; how many.
  std::size_t collect(std::size_t n, double within, std::vector<Found>& found) const {
    const double x = x_[n], y = y_[n], z = z_[n];
    std::size_t count = 0;
    // false: from here on all are too far
    const auto offer = [&](std::size_t i) {
      const double to_x = x - x_[i], to_y = y - y_[i], to_z = z - z_[i], squared_x = to_x * to_x;
      const double squared = squared_x + to_y * to_y + to_z * to_z;
      found[count] = {squared, along_x_[i]};
      count += squared <= within;
      return squared_x <= within;
    };
    std::size_t i = n;
    while (i < x_.size() && offer(i)) ++i;
    for (i = n; i > 0 && offer(i - 1);) --i;
    return count;
  }

  const std::vector<Point>& places_;
  std::vector<std::uint32_t> along_x_;
  std::vector<double> x_, y_, z_;  // of places along x
};

void find_pools(const std::vector<Point>& places, std::vector<std::uint32_t>& pools, const ForEach& for_each) {
  const Pools nearest(places);
  for_each((places.size() + kAtOnce - 1) / kAtOnce, [&](std::size_t block) {
    const std::size_t begin = block * kAtOnce;
    nearest.find(begin, std::min(places.size(), begin + kAtOnce), pools.data());
  });
}

// From rows of all samples to those of samples that show noise.
void copy_pools(const LocalSamples& samples, std::vector<std::uint32_t>& pools) {
  std::vector<std::uint32_t> number;
  std::uint32_t shown = 0;
  for (const point::NoiseSample& sample : samples.noise) number.push_back(sample.shows_noise ? shown++ : 0);
  auto to = pools.begin();
  for (std::size_t i = 0; i < samples.noise.size(); ++i)
    if (samples.noise[i].shows_noise)
      for (std::size_t n = 0; n < kPool; ++n) *to++ = number[samples.pools[i * kPool + n]];
}

// Values by their ranks, where some of few are asked for over and over: the n-th of some is found by a bit for each.
class Ranked {
 public:
  // NaN: not known.
  explicit Ranked(const std::vector<double>& values) : rank_(values.size(), kNone) {
    std::vector<std::pair<double, std::uint32_t>> order;
    order.reserve(values.size());
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isnan(values[i])) order.emplace_back(values[i], static_cast<std::uint32_t>(i));
    std::sort(order.begin(), order.end());
    sorted_.reserve(order.size());
    for (const auto& [value, i] : order) {
      rank_[i] = static_cast<std::uint32_t>(sorted_.size());
      sorted_.push_back(value);
    }
  }

  // Of those of `some` that are known, the one with place(how many) before it; NaN if that is kNoPlace.
  template <class PlaceOf>
  double among(std::span<const std::uint32_t> some, const PlaceOf& place) const {
    std::array<std::uint64_t, 64> few;  // mostly enough
    std::vector<std::uint64_t> many;
    std::uint64_t* bits = few.data();
    const std::size_t words = sorted_.size() / 64 + 1;
    if (words > few.size()) {
      many.resize(words);
      bits = many.data();
    }
    std::fill_n(bits, words, std::uint64_t(0));
    std::size_t known = 0;
    for (const std::uint32_t i : some) {
      const std::uint32_t rank = rank_[i];
      if (rank == kNone) continue;
      bits[rank / 64] |= std::uint64_t(1) << rank % 64;
      ++known;
    }
    std::size_t left = place(known);
    if (left >= known) return kUnknown;
    std::size_t word = 0;
    for (; left >= std::size_t(std::popcount(bits[word])); ++word) left -= std::size_t(std::popcount(bits[word]));
    std::uint64_t rest = bits[word];
    for (; left > 0; --left) rest &= rest - 1;
    return sorted_[word * 64 + std::size_t(std::countr_zero(rest))];
  }
  static constexpr std::size_t kNoPlace = ~std::size_t(0);

 private:
  static constexpr std::uint32_t kNone = ~0u;
  std::vector<double> sorted_;
  std::vector<std::uint32_t> rank_;
};

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

// At the place of the pool's first sample.
Curve pooled(std::span<const std::uint32_t> pool, const std::vector<Ranked>& of_sizes) {
  Curve result;
  for (std::size_t size = 0; size < kSizes; ++size) {
    const double value = of_sizes[size].among(pool, [&](std::size_t known) {
      return 2 * known < pool.size() ? Ranked::kNoPlace : std::size_t(std::lround(kPoolQuantile * double(known - 1)));
    });
    result[size] = value / chance_quantiles()[size];
  }
  return result;
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

std::shared_ptr<const NoiseLevels> noise_levels(const LocalSamples& samples, double typical, const ForEach& for_each) {
  std::vector<Point> places;
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < samples.noise.size(); ++i) {
    if (!samples.noise[i].shows_noise) continue;
    places.push_back(samples.places[i]);
    curves.push_back(curve_of(samples.noise[i], samples.residuals.empty() ? nullptr : &samples.residuals[i]));
  }
  if (!(typical > 0) || places.size() < kFewestSamples) return nullptr;
  std::vector<std::uint32_t> pools(places.size() * kPool);
  std::vector<double> noise(places.size()), log_levels(places.size());
  if (samples.pools.empty()) {
    find_pools(places, pools, for_each);
  } else {
    copy_pools(samples, pools);
  }
  const std::vector<Ranked> of_sizes = ranked(curves);
  for_each(places.size(), [&](std::size_t i) {
    noise[i] = noise_of(pooled(std::span(pools).subspan(i * kPool, kPool), of_sizes), typical);
  });
  const Ranked noises(noise);
  for_each(places.size(), [&](std::size_t i) {
    const double middle =
        noises.among(std::span(pools).subspan(i * kPool, kSmoothed), [](std::size_t known) { return known / 2; });
    const double median = std::isnan(middle) ? typical : middle;
    log_levels[i] = std::log(std::clamp(median / typical, 1 / kLargestLevel, kLargestLevel));
  });
  shrink(log_levels);
  const std::shared_ptr<NoiseLevels> levels = levels_between(places, log_levels, for_each);
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
