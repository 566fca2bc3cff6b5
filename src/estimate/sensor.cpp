// SPDX-License-Identifier: Apache-2.0
#include "estimate/sensor.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"
#include "point/sensor.h"
#include "portable.hpp"

namespace pointfair {
namespace {

using namespace constants;

constexpr int kSecond = 2, kTwelfth = point::kPatternNeighbors;  // nearest
constexpr std::size_t kRow = kTwelfth + 1;

double distance(const Point& a, const Point& b) {
  return portable::hypot(double{a.x} - b.x, double{a.y} - b.y, double{a.z} - b.z);
}

// Of the first points of the sample, whose rows these are.
std::vector<BeamSample> samples_of(std::span<const Point> rows, const CloudSample& sample,
                                   const SensorPlaces& sensors) {
  std::vector<BeamSample> samples;
  for (std::size_t i = 0; i < rows.size() / kRow; ++i) {
    const Point& here = rows[i * kRow];
    const Point& sensor = sensors.places[sensors.places.size() > 1 ? sample.indices[i] : 0];
    const BeamSample its{distance(here, rows[i * kRow + kSecond]), distance(here, rows[i * kRow + kTwelfth]),
                         distance(sample.points[i], sensor)};  // rows may be relative to another origin
    if (std::isfinite(its.twelfth) && std::isfinite(its.range) && its.range > 0) samples.push_back(its);
  }
  return samples;
}

// Of the middle four fifths.
double spread_of_logs(const std::vector<double>& logs) { return quantile(logs, 0.9) - quantile(logs, 0.1); }

double spread(const std::vector<double>& values) {
  return portable::log(quantile(values, 0.9) / quantile(values, 0.1));
}

using point::cross;
using Vec = point::Offset;

// The vector whose product with the rows, and a constant beside it, give the values with the least squares. Where rows
// leave a direction open, as points of one plane do, it is next to 0 there.
std::optional<Vec> least_squares(std::span<const Vec> rows, std::span<const double> values,
                                 std::span<const double> weights) {
  constexpr double kLeast = 1e-9;  // of the mean diagonal element
  double all = 0, mean_value = 0;
  Vec mean{};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    all += weights[i];
    mean_value += weights[i] * values[i];
    mean = mean + weights[i] * rows[i];
  }
  mean = (1 / all) * mean;
  mean_value /= all;
  Vec a{}, b{}, c{}, right{};  // the normal equations
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Vec row = rows[i] - mean, weighted = weights[i] * row;
    a = a + weighted.x * row;
    b = b + weighted.y * row;
    c = c + weighted.z * row;
    right = right + (values[i] - mean_value) * weighted;
  }
  const double added = kLeast * (a.x + b.y + c.z) / 3;
  a.x += added;
  b.y += added;
  c.z += added;
  // by Cramer's rule: the columns of the adjugate are cross products of the rows
  const double determinant = dot(a, cross(b, c));
  if (!(determinant > 0)) return std::nullopt;
  return (1 / determinant) * (right.x * cross(b, c) + right.y * cross(c, a) + right.z * cross(a, b));
}

// Samples around their middle, in units of their extent, and the logarithm of the distance to the second neighbour in
// units of the median.
struct Distances {
  Vec middle{};
  double extent = 0;
  std::vector<Vec> places{};
  std::vector<double> logs{};
};

// Of the first samples; nothing where too few lie apart.
std::optional<Distances> distances_of(const NearestRows& nearest, const CloudSample& sample, std::size_t samples) {
  constexpr std::size_t kHead = kStepNeighbors + 1, kFewest = 100;
  Distances result;
  for (std::size_t i = 0; i < samples; ++i) {
    const double second = distance(nearest.heads()[i * kHead], nearest.heads()[i * kHead + kSecond]);
    if (!(second > 0)) continue;  // points at one place, and NaN
    const Point& p = sample.points[i];
    result.places.push_back({p.x, p.y, p.z});
    result.logs.push_back(second);
  }
  if (result.logs.size() < kFewest) return std::nullopt;
  const double share = 1 / double(result.logs.size()), typical = median(result.logs);
  for (const Vec& place : result.places) result.middle = result.middle + share * place;
  for (Vec& place : result.places) {
    place = place - result.middle;
    result.extent += share * dot(place, place);
  }
  result.extent = std::sqrt(result.extent);
  for (Vec& place : result.places) place = (1 / result.extent) * place;
  for (double& second : result.logs) second = portable::log(second / typical);
  return result.extent > 0 ? std::optional(std::move(result)) : std::nullopt;
}

// Two extents from the middle, to where the distances get shorter.
std::optional<Vec> first_place(const Distances& seen) {
  constexpr double kExtents = 2;
  const std::vector<double> equal(seen.logs.size(), 1.0);
  const std::optional<Vec> slope = least_squares(seen.places, seen.logs, equal);
  if (!slope || !(dot(*slope, *slope) > 0)) return std::nullopt;
  return (-kExtents / std::sqrt(dot(*slope, *slope))) * *slope;
}

struct Residuals {
  std::vector<Vec> ways{};                // from the place
  std::vector<double> squares{}, logs{};  // of the ranges; of distance over range
};

Residuals residuals_from(const Vec& place, const Distances& seen) {
  constexpr double kLeast = 1e-30;
  Residuals result;
  for (std::size_t i = 0; i < seen.logs.size(); ++i) {
    const Vec way = seen.places[i] - place;
    const double square = std::max(kLeast, dot(way, way));
    result.ways.push_back(way);
    result.squares.push_back(square);
    result.logs.push_back(seen.logs[i] - 0.5 * portable::log(square));
  }
  return result;
}

// One step of Gauss and Newton towards the least residuals, with Cauchy's weights: most points lie on surfaces, and
// those that do not, and the borders, have other distances. No step is longer than half of a typical range.
std::optional<Vec> better_place(const Vec& place, const Distances& seen) {
  constexpr double kOfDeviation = 1.5, kLeastDeviation = 1e-9;
  const Residuals from = residuals_from(place, seen);
  const double middle = median(from.logs);
  std::vector<double> deviations;
  for (const double log : from.logs) deviations.push_back(std::abs(log - middle));
  const double scale = kOfDeviation * median(deviations) + kLeastDeviation;
  std::vector<Vec> slopes;
  std::vector<double> weights;
  for (std::size_t i = 0; i < from.logs.size(); ++i) {
    const double off = deviations[i] / scale;
    slopes.push_back((-1 / from.squares[i]) * from.ways[i]);
    weights.push_back(1 / (1 + off * off));
  }
  const std::optional<Vec> step = least_squares(slopes, from.logs, weights);
  if (!step) return std::nullopt;
  const double length = std::sqrt(dot(*step, *step)), longest = 0.5 * std::sqrt(median(from.squares));
  return place + (length > longest ? longest / length : 1.0) * *step;
}

struct Explanation {
  Vec place{};
  double spread = 0;  // of the logarithms of distance over range
};

// The place that explains the distances best, if it leaves no more than this share of their spread.
std::optional<Explanation> explanation(const std::optional<Distances>& seen, int rounds, double most) {
  if (!seen) return std::nullopt;
  std::optional<Vec> place = first_place(*seen);
  for (int round = 0; round < rounds && place; ++round) place = better_place(*place, *seen);
  if (!place) return std::nullopt;
  const double left = spread_of_logs(residuals_from(*place, *seen).logs);
  if (!(left <= most * spread_of_logs(seen->logs))) return std::nullopt;
  return Explanation{*place, left};
}

}  // namespace

std::vector<BeamSample> beam_samples(Sampling& from, const CloudSample& sample, const SensorPlaces& sensors) {
  std::vector<Point> rows(sample.indices.size() * kRow);
  from.sample_neighborhoods(sample.indices, kTwelfth, rows);
  return samples_of(rows, sample, sensors);
}

double beam_width(std::span<const BeamSample> samples) {
  std::vector<double> distances, steps, widths;
  for (const BeamSample& its : samples) {
    if (!(its.second > 0)) continue;  // points at one place
    distances.push_back(its.second);
    steps.push_back(its.second / its.range);
    widths.push_back(its.twelfth / its.range);
  }
  if (steps.empty() || spread(steps) > kStepSpread * spread(distances)) return 0;
  return quantile(widths, 0.5);
}

KnownSensor find_sensor(const NearestRows& nearest, const CloudSample& sample) {
  const std::size_t samples = nearest.looked_at();
  if (!explanation(distances_of(nearest, sample, std::min(samples, kGlancedAt)), kGlanceRounds, kGlanceSpread))
    return {};
  const std::optional<Distances> seen = distances_of(nearest, sample, samples);
  const std::optional<Explanation> found = explanation(seen, kPlaceRounds, kPlaceSpread);
  if (!found || !(found->spread <= kMostStepSpread)) return {};
  const Vec place = seen->middle + seen->extent * found->place;
  const auto its =
      std::make_shared<const SensorPlaces>(SensorPlaces{{{float(place.x), float(place.y), float(place.z)}}});
  const KnownSensor sensor{its, beam_width(samples_of(nearest.of(samples, kTwelfth), sample, *its))};
  return sensor.beam_width > 0 ? sensor : KnownSensor{};
}

}  // namespace pointfair
