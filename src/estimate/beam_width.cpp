// SPDX-License-Identifier: Apache-2.0
#include "estimate/beam_width.hpp"

#include <cmath>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"
#include "point/sensor.h"
#include "portable.hpp"

namespace pointfair {
namespace {

constexpr int kSecond = 2, kTwelfth = point::kPatternNeighbors;  // nearest

double distance(const Point& a, const Point& b) {
  return portable::hypot(double{a.x} - b.x, double{a.y} - b.y, double{a.z} - b.z);
}

// Of the logarithms of the middle four fifths.
double spread(const std::vector<double>& values) {
  return portable::log(quantile(values, 0.9) / quantile(values, 0.1));
}

}  // namespace

std::vector<BeamSample> beam_samples(Sampling& from, const CloudSample& sample, const SensorPlaces& sensors) {
  constexpr std::size_t kRow = kTwelfth + 1;
  std::vector<Point> rows(sample.indices.size() * kRow);
  from.sample_neighborhoods(sample.indices, kTwelfth, rows);
  std::vector<BeamSample> samples;
  for (std::size_t i = 0; i < sample.indices.size(); ++i) {
    const Point& here = rows[i * kRow];
    const Point& sensor = sensors.places[sensors.places.size() > 1 ? sample.indices[i] : 0];
    const BeamSample its{distance(here, rows[i * kRow + kSecond]), distance(here, rows[i * kRow + kTwelfth]),
                         distance(sample.points[i], sensor)};  // rows may be relative to another origin
    if (std::isfinite(its.twelfth) && std::isfinite(its.range) && its.range > 0) samples.push_back(its);
  }
  return samples;
}

double beam_width(std::span<const BeamSample> samples) {
  std::vector<double> distances, steps, widths;
  for (const BeamSample& its : samples) {
    if (!(its.second > 0)) continue;  // points at one place
    distances.push_back(its.second);
    steps.push_back(its.second / its.range);
    widths.push_back(its.twelfth / its.range);
  }
  if (steps.empty() || spread(steps) > constants::kStepSpread * spread(distances)) return 0;
  return quantile(widths, 0.5);
}

}  // namespace pointfair
