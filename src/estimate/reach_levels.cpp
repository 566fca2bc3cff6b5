// SPDX-License-Identifier: Apache-2.0
#include "estimate/reach_levels.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "estimate/share_between.hpp"
#include "point/noise_field.h"
#include "portable.hpp"

namespace pointfair {
namespace {

using namespace constants;

using Risks = std::array<double, point::kPlaneSizes>;  // over the sizes of neighbourhoods

// The error that a step over k points leaves, in variances of the noise (Eq. 23). The step makes the share w of each
// displacement (Eq. 22): that share of the variance falls to 1 / k, and the rest of it stays. kWidthDamage counts the
// damage to the shape for all averages of a run. Where the points have no plane, all of the variance stays.
Risks risks_of(const point::PlaneSample& planes, double noise_variance) {
  Risks risks;
  for (int size = 0; size < point::kPlaneSizes; ++size) {
    const double k = point::plane_points(size), variance = planes.variance[size];
    const double shape = std::max(0.0, variance / noise_variance - 1 - double(point::kChance));
    const double damage = kWidthDamage * shape;
    risks[std::size_t(size)] = variance < 0 ? 1 : (damage + 1 / k) / (1 + damage);
  }
  return risks;
}

Risks mean_of(std::span<const std::uint32_t> pool, const std::vector<Risks>& risks) {
  Risks mean{};
  for (const std::uint32_t i : pool)
    for (std::size_t size = 0; size < mean.size(); ++size) mean[size] += risks[i][size] / double(pool.size());
  return mean;
}

// The logarithm of the number of points of least risk, on the parabola through the least one and its neighbours.
double log_best_count(const Risks& risks) {
  const auto log_points = [](std::ptrdiff_t size) { return portable::log(double(point::plane_points(int(size)))); };
  const std::ptrdiff_t least = std::ranges::min_element(risks) - risks.begin();
  const std::ptrdiff_t at = std::clamp<std::ptrdiff_t>(least, 1, point::kPlaneSizes - 2);
  const double before = risks[std::size_t(at - 1)], here = risks[std::size_t(at)], after = risks[std::size_t(at + 1)];
  const double bend = before - 2 * here + after;
  const double place = bend > 0 ? std::clamp((before - after) / (2 * bend), -1.0, 1.0) : double(least - at);
  return log_points(at) + place * (log_points(at + 1) - log_points(at - 1)) / 2;
}

}  // namespace

std::vector<double> log_reach_levels(const LocalSamples& samples, const std::vector<double>& noise, int surface_points,
                                     const ForEach& for_each) {
  const std::size_t count = samples.places.size();
  std::vector<Risks> risks(count);
  std::vector<double> log_levels(count), smooth(count);
  for_places(count, for_each,
             [&](std::size_t i) { risks[i] = risks_of(samples.residuals[i].planes, noise[i] * noise[i]); });
  const double farthest = portable::log(kWidestReach),
               unchanged = portable::log(std::max<double>(kReachPoints, surface_points));
  for_places(count, for_each, [&](std::size_t i) {
    // a neighbourhood holds as many points as its area is large
    const double log_level = (log_best_count(mean_of(samples.pool(i), risks)) - unchanged) / 2;
    const double fading = share_between(0, kNoiseOfWidth, noise[i] / samples.noise[i].spacing);
    log_levels[i] = (1 - fading) * std::clamp(log_level, -farthest, farthest);
  });
  for_places(count, for_each, [&](std::size_t i) { smooth[i] = median_known(samples.near(i), log_levels); });
  return smooth;
}

}  // namespace pointfair
