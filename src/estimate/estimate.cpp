// SPDX-License-Identifier: Apache-2.0
#include "estimate/estimate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "estimate/noise_levels.hpp"
#include "estimate/share_between.hpp"

namespace pointfair {
namespace {

// Of the cloud's sample, all of which serves the spacing: for the noise as a whole, and from place to place one for so
// many points of the cloud, all of the sample at most.
constexpr std::size_t kNoiseSamples = 500;
constexpr std::uint64_t kPointsOfPlace = 200;
constexpr double kSheetShare = 0.1;     // of the samples; fewer that see two sheets are corners and outliers
constexpr double kPlaneQuartile = 1.2;  // of a plane's own variances, by chance
constexpr double kDoubtfulNoise = 0.6;  // spacings; below it residuals may be shape
// How residuals grow from one neighbourhood to one of twice the points where they are noise, where they are shape.
constexpr double kNoiseGrowth = 1.35, kShapeGrowth = 1.5;
// The same of the medians: of noise alone (fewer points scatter more), and of the variances of shape.
constexpr double kOwnGrowth = 1.05, kShapeVarianceGrowth = 4;
constexpr double kNearFlat = 2;  // of the flattest places' residual; larger ones are beyond the similarity sigma
constexpr double kBeyondResiduals = 1.7;  // spacings; of much noise neighbourhoods of 115 points show nothing
constexpr double kEndless = 1e9;
// Noise that is alike in neighbouring points: how much residuals grow even in the flattest places (1.09 is chance), the
// variance at most (more is shape), what it grows then over that (more is shape), and the noise in spacings.
constexpr double kAlikeGrowth[] = {1.14, 1.18}, kUnlikeGrowth[] = {1.5, 1.0};
constexpr double kAlikeSlowing[] = {1.2, 0.9}, kAlikeNoise[] = {0.05, 0.1};

double quantile(std::vector<double> values, double share) {
  const auto place = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

}  // namespace

Frame frame_of(const CloudSample& sample) {
  if (sample.points.empty()) return {};
  std::array<std::vector<double>, 3> axes;
  for (const Point& p : sample.points) {
    axes[0].push_back(p.x);
    axes[1].push_back(p.y);
    axes[2].push_back(p.z);
  }
  std::array<double, 3> low{};
  double extent = 0, widest = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = quantile(axes[a], 0.02);
    extent = std::max(extent, quantile(axes[a], 0.98) - low[a]);
    const auto [least, most] = std::minmax_element(axes[a].begin(), axes[a].end());
    widest = std::max(widest, *most - *least);
  }
  if (!(extent > 0)) extent = widest;  // nearly all in one place
  // a fifth of the side lies below the reference point, and at least as much above what is between the quantiles
  const float side = extent > 0 ? float(std::exp2(std::ceil(std::log2(1.75 * extent)))) : 0.0f;
  return {sample.bounds.min, {float(low[0]), float(low[1]), float(low[2])}, side};
}

namespace {

Spacing spacing_of(const std::vector<point::SpacingSample>& samples) {
  std::vector<double> means, last;
  for (const point::SpacingSample& sample : samples) {
    if (sample.last < 0) continue;
    means.push_back(sample.mean);
    last.push_back(sample.last);
  }
  if (last.empty()) return {};
  // without the loneliest 2 %: a stray point's distance is no spacing
  const auto lonely = means.end() - std::ptrdiff_t(means.size() / 50);
  std::nth_element(means.begin(), lonely, means.end());
  means.erase(lonely, means.end());
  return {std::accumulate(means.begin(), means.end(), 0.0) / double(means.size()), quantile(last, 0.95)};
}

// How residuals grow from neighbourhoods of some points to those of twice as many: hardly where they are noise.
struct Growth {
  double flat = 1, typical = 1;  // of the 15 % quantiles and of the medians
  double first = 0, second = 0;  // of the mean variance in flat places, less one; from there to twice as many again
};

Growth residual_growth(const std::vector<point::ResidualSample>& samples) {
  const auto growth_at = [&](double share, double most) {
    std::vector<double> from, to;
    for (const point::ResidualSample& s : samples) {
      if (s.narrow < 0 || s.wide < 0 || s.narrow > most) continue;
      from.push_back(s.narrow);
      to.push_back(s.wide);
    }
    if (from.empty()) return 1.0;
    const double low = quantile(from, share), high = quantile(to, share);
    return low > 0 ? high / low : high > 0 ? kEndless : 1;
  };
  std::vector<double> known;
  for (const point::ResidualSample& s : samples)
    if (s.narrow >= 0) known.push_back(s.narrow);
  if (known.empty()) return {};
  const double near_flat = kNearFlat * quantile(known, 0.15);
  Growth growth{growth_at(0.15, kEndless), growth_at(0.5, near_flat)};
  double variance[3] = {};
  for (const point::ResidualSample& s : samples) {
    if (s.narrow < 0 || s.wide < 0 || s.widest < 0) continue;
    if (s.narrow > near_flat || s.widest > kNearFlat * near_flat) continue;
    variance[0] += s.narrow * s.narrow;
    variance[1] += s.wide * s.wide;
    variance[2] += s.widest * s.widest;
  }
  if (variance[0] > 0 && variance[1] > 0) {
    growth.first = variance[1] / variance[0] - 1;
    growth.second = variance[2] / variance[1] - 1;
  }
  return growth;
}

// Residuals of shape grow faster and faster with the neighbourhood, those of noise that is alike in neighbouring points
// ever less.
double alikeness(const Growth& growth, double sigma_in_spacings) {
  if (!(growth.first > 0)) return 0;
  return share_between(kAlikeGrowth, growth.flat) * share_between(kUnlikeGrowth, growth.first) *
         share_between(kAlikeSlowing, growth.second / growth.first) * share_between(kAlikeNoise, sigma_in_spacings);
}

double likeness_to_shape(double flat_growth) { return share_between(kNoiseGrowth, kShapeGrowth, flat_growth); }

// Variances of noise stay, those of shape grow fourfold: g^2 = (1 + 4 x) / (1 + x).
double shape_to_noise(double typical_growth) {
  const double squared = typical_growth * typical_growth / (kOwnGrowth * kOwnGrowth);
  if (squared >= kShapeVarianceGrowth) return kEndless;
  return std::max(0.0, (squared - 1) / (kShapeVarianceGrowth - squared));
}

// `residuals` are asked for where they are read.
Noise noise_of(std::span<const point::NoiseSample> samples,
               const std::function<std::vector<point::ResidualSample>()>& residuals) {
  std::vector<double> sigmas, spacings, gaps, plane_variances;
  std::size_t confined = 0;
  for (const point::NoiseSample& sample : samples) {
    if (!sample.shows_noise) continue;
    sigmas.push_back(sample.sigma);
    spacings.push_back(sample.spacing);
    plane_variances.push_back(sample.plane_variance);
    if (!sample.is_wide) ++confined;
    if (sample.gap > 0) gaps.push_back(sample.gap);
  }
  if (sigmas.empty()) return {};
  // Where noise is all there is, residuals spread little; where curvature adds to them, the least ones know more.
  const double sigma = std::min(quantile(sigmas, 0.35), 1.2 * quantile(sigmas, 0.15));
  Noise noise{sigma, quantile(spacings, 0.5)};
  if (sigma > 0) noise.bend = quantile(plane_variances, 0.75) / (kPlaneQuartile * sigma * sigma);
  noise.confined = double(confined) / double(sigmas.size());
  if (double(gaps.size()) > kSheetShare * double(sigmas.size())) noise.gap = quantile(gaps, 0.25);
  if (sigma < kDoubtfulNoise * noise.surface_spacing) {
    const Growth growth = residual_growth(residuals());
    noise.likeness_to_shape = likeness_to_shape(growth.flat);
    noise.alikeness = alikeness(growth, sigma / noise.surface_spacing);
    // between two sheets, wide neighbourhoods see the other one and not shape
    if (noise.gap == 0) noise.shape_to_noise = (1 - noise.alikeness) * shape_to_noise(growth.typical);
  }
  return noise;
}

}  // namespace

Noise of_sigma(Noise noise, double sigma) {
  if (noise.sigma > 0) noise.bend *= (noise.sigma / sigma) * (noise.sigma / sigma);
  noise.sigma = sigma;
  return noise;
}

Estimate estimate(Sampling& from, const CloudSample& sample, WantedEstimates wanted, const std::stop_token& stop) {
  const std::span<const std::uint32_t> queries = sample.indices;
  const std::size_t of_places =
      std::size_t(std::max<std::uint64_t>(kNoiseSamples, sample.bounds.valid / kPointsOfPlace));
  const std::size_t noises = wanted.noise ? std::min(queries.size(), of_places) : 0;
  const Samples samples = from.take_samples(wanted.spacing ? queries : queries.first(0), queries.first(noises), stop);
  Estimate result{spacing_of(samples.spacing), {}};
  if (!wanted.noise) return result;
  std::optional<std::vector<point::ResidualSample>> residuals;  // of all places
  const auto all_residuals = [&] {
    if (!residuals) residuals = samples.residuals();
    return *residuals;
  };
  const std::size_t first = std::min(noises, kNoiseSamples);
  result.noise = noise_of(std::span(samples.noise).first(first), [&] {
    std::vector<point::ResidualSample> of_first = all_residuals();
    of_first.resize(first);
    return of_first;
  });
  if (result.noise.sigma < kBeyondResiduals * result.noise.surface_spacing) all_residuals();
  result.levels = noise_levels(
      {std::span(sample.points).first(noises), samples.noise,
       residuals ? std::span<const point::ResidualSample>(*residuals) : std::span<const point::ResidualSample>()},
      result.noise.sigma,
      [&from](std::size_t count, const std::function<void(std::size_t)>& body) { from.for_each_on_host(count, body); });
  return result;
}

}  // namespace pointfair
