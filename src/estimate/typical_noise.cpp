// SPDX-License-Identifier: Apache-2.0
#include "estimate/typical_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"
#include "estimate/residual_growth.hpp"

namespace pointfair {
using namespace constants;

namespace {

// The fewest nearest points that lie in a plane at most samples; 0 where none do.
int points_of_planes(std::span<const point::ResidualSample> samples) {
  for (int size = 0; size < point::kPlaneSizes; ++size) {
    const auto planes = std::ranges::count_if(
        samples, [size](const point::ResidualSample& sample) { return sample.planes.variance[size] >= 0; });
    if (2 * std::size_t(planes) > samples.size()) return point::plane_points(size);
  }
  return 0;
}

}  // namespace

Noise noise_of(std::span<const point::NoiseSample> samples, bool depth_has_steps) {
  std::vector<double> sigmas, spacings, gaps;
  std::size_t confined = 0, tubes = 0;
  for (const point::NoiseSample& sample : samples) {
    tubes += sample.is_tube;
    if (!sample.shows_noise) continue;
    sigmas.push_back(sample.sigma);
    spacings.push_back(sample.spacing);
    if (!sample.is_wide) ++confined;
    if (sample.gap > 0) gaps.push_back(sample.gap);
  }
  if (sigmas.empty()) return {};
  // Residuals of noise alone spread little. Where curvature adds to some of them, the least ones are nearer to the
  // noise.
  const double sigma = std::min(quantile(sigmas, kNoiseQuantile), kMostOverLeast * quantile(sigmas, kLeastQuantile));
  Noise noise{sigma, quantile(spacings, 0.5)};
  noise.confined = double(confined) / double(sigmas.size());
  // levels of depth are no sheets
  const double sheets = double(gaps.size()) / double(sigmas.size() + tubes);
  if (!depth_has_steps && gaps.size() > tubes && sheets > kSheetShare) {
    noise.gap = quantile(gaps, kGapQuantile);
    noise.sheets = sheets;
  }
  noise.depth_has_steps = depth_has_steps;
  noise.is_shared = depth_has_steps;
  return noise;
}

bool are_tubes(std::span<const point::NoiseSample> samples, std::span<const point::ResidualSample> residuals) {
  const auto tubes = std::ranges::count_if(samples, &point::NoiseSample::is_tube);
  const auto surfaces = std::ranges::count_if(residuals, [](const auto& sample) { return sample.narrow >= 0; });
  return 2 * tubes > (surfaces > 0 ? surfaces : std::ptrdiff_t(samples.size()));
}

bool may_be_thin(Sampling& from, const Samples& samples, std::span<const std::uint32_t> queries,
                 const std::stop_token& stop) {
  if (queries.size() < kNoiseSamples) return false;
  std::size_t shown = 0;
  std::vector<std::uint32_t> thin;
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < kNoiseSamples; ++i) {
    const point::NoiseSample& sample = samples.noise[i];
    shown += sample.shows_noise;
    if (!sample.may_be_sheets || sample.is_tube) continue;
    thin.push_back(queries[i]);
    sigmas.push_back(sample.sigma);
  }
  if (!(double(thin.size()) > kThinShare * double(shown)) || are_tubes(samples.noise, samples.residuals()))
    return false;
  if (noise_of(samples.noise, false).gap > 0) return false;
  std::vector<double> beyond = from.beyond_two(thin, sigmas, stop);
  std::erase_if(beyond, [](double share) { return share < 0; });
  const double total = std::accumulate(beyond.begin(), beyond.end(), 0.0);
  return total > kBeyondEven * double(beyond.size());
}

double most_noise(std::span<const point::ResidualSample> samples, double spacing) {
  std::array<std::vector<double>, 3> few, growth;
  for (const point::ResidualSample& sample : samples) {
    const double of_six = sample.planes.variance[0], of_eleven = sample.planes.variance[1];
    if (of_six >= 0) few[0].push_back(std::sqrt(of_six));
    if (of_eleven >= 0) few[1].push_back(std::sqrt(of_eleven));
    if (sample.least >= 0) few[2].push_back(sample.least);
    const double residuals[] = {of_eleven < 0 ? -1 : std::sqrt(of_eleven), sample.narrow, sample.wide, sample.widest};
    for (std::size_t size = 0; size < growth.size(); ++size) {
      const double from = residuals[size], to = residuals[size + 1];
      if (from >= 0 && to >= 0) growth[size].push_back(from > 0 ? to / from : to > 0 ? kEndless : 1);
    }
  }
  const auto of_most = [&](const std::vector<double>& values) { return 2 * values.size() > samples.size(); };
  double shown = kEndless;
  for (std::size_t size = 0; size < few.size(); ++size) {
    if (!of_most(growth[size]) || median(growth[size]) < kGrowthOfShape[size]) return kEndless;
    if (of_most(few[size])) shown = std::min(shown, quantile(few[size], kFlattest) / kShownByFlattest[size]);
  }
  const double hidden = shown / (kHiddenFromFew * spacing);
  return hidden < 1 ? kMostOverFlattest * shown * (1 + hidden * hidden * hidden) : kEndless;
}

void add_residuals(Noise& noise, std::span<const point::ResidualSample> samples, std::uint64_t points) {
  const int of_planes = points_of_planes(samples), most = point::plane_points(point::kPlaneSizes - 1);
  noise.surface_points = std::min(of_planes, kMaxMinNeighbors);
  noise.is_of_lines = points > std::uint64_t(most) && (of_planes == 0 || of_planes > kMaxMinNeighbors);
  if (noise.sigma < kDoubtfulNoise * noise.surface_spacing) {
    const double correlated = correlation(samples);
    noise.is_shared = correlated >= kMostlyCorrelated;
    // between two sheets, wide neighbourhoods see the other one and not shape
    if (noise.gap == 0) noise.shape_to_noise = (1 - correlated) * shape_to_noise(samples);
  }
}

}  // namespace pointfair
