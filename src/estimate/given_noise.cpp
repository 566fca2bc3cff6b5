// SPDX-License-Identifier: Apache-2.0
#include "estimate/given_noise.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "estimate/node_grid.hpp"
#include "estimate/noise_levels.hpp"
#include "portable.hpp"

namespace pointfair {
namespace {

using namespace constants;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr Point kNowhere{kNaN, kNaN, kNaN};

bool says(float value) { return value > 0 && std::isfinite(value); }

}  // namespace

Noise with_given(Noise measured, const GivenNoise& given) {
  measured.without_surface = 0;
  return of_sigma(measured, given.sigma);
}

GivenNoise given_noise(double sigma, const CloudSample& sample, std::span<const float> values,
                       const ForEach& for_each) {
  std::vector<double> log_levels;
  for (const float value : values)
    log_levels.push_back(portable::log(std::clamp(value / sigma, 1 / kLargestLevel, kLargestLevel)));
  return GivenNoise{sigma, noise_levels(sample.points, std::move(log_levels), for_each)};
}

std::optional<GivenNoise> given_noise(std::span<const float> values, std::span<const Point> points,
                                      const ForEach& for_each) {
  std::vector<float> known;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (says(values[i]) && is_indexed(points[i])) known.push_back(values[i]);
  if (known.empty()) return std::nullopt;
  const auto middle = known.begin() + std::ptrdiff_t(known.size() / 2);
  std::nth_element(known.begin(), middle, known.end());
  const double sigma = *middle;
  const auto point_at = [&](std::size_t i) {
    return std::pair(says(values[i]) ? points[i] : kNowhere, static_cast<std::uint32_t>(i));
  };
  const CloudSample sample = sample_points(points.size(), point_at, kMostGivenPlaces, for_each);
  std::vector<float> of_sample;
  for (const std::uint32_t i : sample.indices) of_sample.push_back(values[i]);
  return given_noise(sigma, sample, of_sample, for_each);
}

}  // namespace pointfair
