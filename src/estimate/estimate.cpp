// SPDX-License-Identifier: Apache-2.0
#include "estimate/estimate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "estimate/automatic_values.hpp"
#include "estimate/constants.hpp"
#include "estimate/coordinate_steps.hpp"
#include "estimate/correlated_noise.hpp"
#include "estimate/hidden_surface.hpp"
#include "estimate/node_grid.hpp"
#include "estimate/noise_levels.hpp"
#include "estimate/quantile.hpp"
#include "estimate/reach_levels.hpp"
#include "estimate/repeats.hpp"
#include "estimate/residual_growth.hpp"
#include "estimate/triangulation.hpp"
#include "estimate/typical_noise.hpp"
#include "pointfair/params.hpp"
#include "portable.hpp"

namespace pointfair {
using namespace constants;

Frame frame_of(const CloudSample& sample) {
  if (sample.points.empty()) return {};
  std::array<float, 3> low{};
  double extent = 0, widest = 0;
  std::vector<float> values(sample.points.size());
  for (std::size_t a = 0; a < 3; ++a) {
    std::ranges::transform(sample.points, values.begin(), [a](const Point& p) {
      return a == 0 ? p.x : a == 1 ? p.y : p.z;
    });
    const auto place_of = [&](double share) {
      return values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    };
    const auto lower = place_of(0.02), upper = place_of(0.98);
    std::nth_element(values.begin(), lower, values.end());
    low[a] = *lower;
    std::nth_element(lower, upper, values.end());
    extent = std::max(extent, double{*upper} - low[a]);
    const auto [least, most] = std::ranges::minmax(values);
    widest = std::max(widest, double{most} - least);
  }
  if (!(extent > 0)) extent = widest;  // nearly all in one place
  // a fifth of the side lies below the reference point, and at least as much above what is between the quantiles
  const float side = extent > 0 ? float(portable::power_of_two_above(1.75 * extent)) : 0.0f;
  return {sample.bounds.min, {low[0], low[1], low[2]}, side};
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

// What steps add to the noise, in steps. Rounding spreads evenly over one step. The depth of a camera that matches
// patterns errs by half a step, of half a disparity (Khoshelham and Elberink 2012).
double noise_of_steps(CoordinateSteps::Kind kind) {
  return kind == CoordinateSteps::Kind::depth ? kNoiseOfDepthSteps : 1 / std::sqrt(12.0);
}

// Points on one value of a coordinate fit a plane exactly, so their residuals are 0 however large the noise is.
// Samples therefore get at least the noise that the steps add.
void cover_rounding(const CoordinateSteps& steps, std::vector<point::NoiseSample>& samples) {
  for (std::size_t i = 0; i < std::min(samples.size(), steps.at.size()); ++i) {
    if (!samples[i].shows_noise) continue;
    const double added = noise_of_steps(steps.kind) * steps.at[i];
    samples[i].sigma = std::max(samples[i].sigma, added);
    if (samples[i].gap < kStepsOfGap * steps.at[i]) samples[i].gap = 0;
  }
}

void cover_rounding(const CoordinateSteps& steps, std::vector<point::ResidualSample>& samples) {
  for (std::size_t i = 0; i < std::min(samples.size(), steps.at.size()); ++i) {
    const double added = noise_of_steps(steps.kind) * steps.at[i];
    for (double* residual : {&samples[i].least, &samples[i].narrow, &samples[i].wide, &samples[i].widest})
      if (*residual >= 0) *residual = std::max(*residual, added);
    for (double& variance : samples[i].planes.variance)
      if (variance >= 0) variance = std::max(variance, added * added);
  }
}

// Adds the levels of the noise, which is at most `most`, and of the reach, if there are enough samples.
void add_local(Estimate& result, LocalSamples& samples, double most, const ForEach& for_each) {
  if (!(result.noise.sigma > 0) || samples.places.size() < kPool) return;
  if (samples.pools.empty()) samples.pools = pools_of(samples.places, for_each);
  LocalNoise noise = local_noise(samples, result.noise.sigma, most, for_each);
  // between two sheets, places show both
  if (result.noise.gap == 0) result.noise.sigma = noise.typical;
  std::vector<std::vector<double>> fields{std::move(noise.log_levels)};
  if (!result.noise.depth_has_steps)  // a matcher's windows are wider than any of them
    fields.push_back(log_reach_levels(samples, noise.at_samples, result.noise.surface_points, for_each));
  std::vector<NodeLevels> levels = levels_between(samples.places, fields, for_each);
  result.levels = noise_levels(std::move(levels[0]), fields[0]);
  if (fields.size() > 1) result.reach_levels = std::make_shared<const NodeLevels>(std::move(levels[1]));
}

// The rows of pools, with samples numbered among those that show noise; empty if there are no rows.
std::vector<std::uint32_t> pools_of_shown(const Samples& samples, const ForEach& for_each) {
  if (samples.pools.empty() || std::ranges::all_of(samples.noise, &point::NoiseSample::shows_noise))
    return samples.pools;
  std::vector<std::uint32_t> number;
  std::uint32_t shown = 0;
  for (const point::NoiseSample& sample : samples.noise) number.push_back(sample.shows_noise ? shown++ : 0);
  std::vector<std::uint32_t> rows(shown * kPool);
  for_each(samples.noise.size(), [&](std::size_t i) {
    for (std::size_t n = 0; n < kPool && samples.noise[i].shows_noise; ++n)
      rows[number[i] * kPool + n] = number[samples.pools[i * kPool + n]];
  });
  return rows;
}

}  // namespace

Noise of_sigma(Noise noise, double sigma) {
  noise.sigma = sigma;
  return noise;
}

std::size_t noise_queries(const CloudSample& sample, int repeats) {
  const std::uint64_t points = sample.bounds.valid;
  const std::uint64_t of_cloud = std::clamp<std::uint64_t>(points / kPointsOfSample, kLeastSamples, kNoiseSamples);
  const std::uint64_t places = points / std::uint64_t(repeats) / kPointsOfPlace;
  return std::min(sample.indices.size(), std::size_t(std::max(of_cloud, places)));
}

namespace {

// Where the cloud hides a surface among what is none: the noise of that surface, and next to none elsewhere, so that
// what is no surface keeps its place.
void add_hidden_surface(Estimate& result, const HiddenSurface& hidden, const CloudSample& sample,
                        const ForEach& for_each) {
  std::vector<point::NoiseSample> of_surface;
  std::vector<Point> places;
  std::vector<double> noise;  // at these; 0 where no surface shows
  for (std::size_t i = 0; i < hidden.samples.size(); ++i) {
    if (!hidden.samples[i].shows_noise) continue;
    if (hidden.on_surface[i]) of_surface.push_back(hidden.samples[i]);
    places.push_back(sample.points[i]);
    noise.push_back(hidden.on_surface[i] ? hidden.samples[i].sigma : 0);
  }
  result.noise = noise_of(of_surface, false);
  result.noise.gap = 0;  // with one, a run follows no levels, and these keep in place what is no surface
  result.noise.without_surface = 1 - double(of_surface.size()) / double(places.size());
  if (!(result.noise.sigma > 0)) return;
  for (double& level : noise) level = portable::log(std::clamp(level / result.noise.sigma, kNextToNone, kLargestLevel));
  result.levels = noise_levels(places, std::move(noise), for_each);
}

// Levels times a factor.
std::shared_ptr<const NodeLevels> times(std::shared_ptr<const NodeLevels> levels, double factor) {
  if (factor == 1) return levels;
  auto scaled = levels ? NodeLevels(*levels) : NodeLevels{std::vector<float>(8, 1.0f), 2, {}, 0};
  for (float& level : scaled.levels) level *= float(factor);
  return std::make_shared<const NodeLevels>(std::move(scaled));
}

// The noise, and its levels and those of the reach, of a cloud whose surface is there for all to see. Returns the
// residuals of the samples that the noise is of.
std::vector<point::ResidualSample> add_noise_of(Estimate& result, const Samples& samples, const CoordinateSteps& steps,
                                                const CloudSample& sample, int repeats, const ForEach& for_each) {
  const bool depth_has_steps = steps.kind == CoordinateSteps::Kind::depth;
  const std::size_t noises = samples.noise.size(), first = std::min(noises, kNoiseSamples);
  Noise& noise = result.noise;
  std::vector<point::ResidualSample> residuals = samples.residuals();  // of all places
  if (!are_tubes(samples.noise, residuals)) noise = noise_of(std::span(samples.noise).first(first), depth_has_steps);
  noise.repeats = repeats;
  noise.without_surface = noise.surface_spacing > 0 ? 0 : 1;
  if (noise.without_surface > 0) return {};
  cover_rounding(steps, residuals);
  if (!depth_has_steps)
    add_residuals(noise, std::span(residuals).first(first), sample.bounds.valid / std::uint64_t(repeats));
  const bool may_be_shape = repeats == 1 && !depth_has_steps;
  const double most = may_be_shape ? most_noise(std::span(residuals).first(first), noise.surface_spacing) : kEndless;
  noise.sigma = std::min(noise.sigma, most);
  LocalSamples local;
  for (std::size_t i = 0; i < noises; ++i) {
    if (!samples.noise[i].shows_noise) continue;
    local.places.push_back(sample.points[i]);
    local.noise.push_back(samples.noise[i]);
    local.residuals.push_back(residuals[i]);
  }
  local.pools = pools_of_shown(samples, for_each);
  add_local(result, local, most, for_each);
  // min_neighbors end with kMaxMinNeighbors
  result.reach_levels = times(std::move(result.reach_levels),
                              std::sqrt(std::max(1.0, double(kMinNeighbors) * repeats / kMaxMinNeighbors)));
  residuals.resize(first);
  return residuals;
}

// What samples show.
struct Seen {
  Estimate estimate;
  std::vector<point::ResidualSample> residuals{};  // as add_noise_of() returns them
  HiddenSurface hidden;
};

// Whether the noise is so large against the spacing, or against so many spacings, that neighbourhoods of few points cut
// it off.
bool is_dense(const Noise& noise, double spacings = 1) {
  return noise.sigma > kDenseNoise * spacings * noise.surface_spacing;
}

// Whether thinned samples saw the noise and no shape that is as large.
bool shows_noise_alone(const Seen& seen) {
  const Noise& noise = seen.estimate.noise;
  return noise.sigma > 0 && noise.gap == 0 && noise.confined < kConfinedThinned &&
         residual_growth(seen.residuals).typical < kGrowthThinned;
}

}  // namespace

Estimate estimate(Sampling& from, const CloudSample& sample, WantedEstimates wanted, const std::stop_token& stop) {
  const std::span<const std::uint32_t> queries = sample.indices;
  const std::span<const std::uint32_t> for_noise = queries.first(wanted.noise ? noise_queries(sample) : 0);
  const std::span<const std::uint32_t> first_samples = for_noise.first(std::min(for_noise.size(), kNoiseSamples));
  Samples samples = from.take_samples(wanted.spacing ? queries : queries.first(0), for_noise, stop);
  if (!wanted.noise) return {spacing_of(samples.spacing), {}};
  if (wanted.nearest > 0 && !for_noise.empty()) from.foresee_nearest(wanted.nearest);
  const NearestRows nearest(for_noise.size(), std::move(samples.near), [&](std::size_t count, int neighbors) {
    std::vector<Point> rows(count * std::size_t(neighbors + 1));
    from.sample_neighborhoods(for_noise.first(count), neighbors, rows);
    return rows;
  });
  const ForEach for_each = from.on_host();
  if (wanted.seeks_copies)
    if (const CopiesFound copies = copies_at_samples(nearest, for_each); copies.within >= 0) {
      Estimate with_copies;
      with_copies.copies = copies;
      return with_copies;
    }
  Seen seen;
  const auto look = [&](const CoordinateSteps& steps, int repeats, const std::vector<Point>& rows) {
    seen = {};
    for_each(rows.empty() ? 1 : 2, [&](std::size_t which) {  // at the same time, since few clouds hide a surface
      if (which == 0)
        seen.residuals = add_noise_of(seen.estimate, samples, steps, sample, repeats, for_each);
      else
        seen.hidden = find_hidden_surface(rows, samples.noise, for_each);
    });
    if (!rows.empty() && seen.hidden.on_surface.empty())
      seen.hidden = find_quiet_surface(samples.noise, samples.residuals);
  };
  Spacing spacing;
  Repeats found;
  StepsInHeads in_heads;
  KnownSensor sensor;
  const std::vector<Point> rows = rows_of_hidden(nearest, samples.noise);
  const bool is_thin = may_be_thin(from, samples, for_noise, stop);
  // At the same time, since each has serial parts. Most clouds have neither repeats nor steps.
  for_each(5, [&](std::size_t which) {
    if (which == 0 && !is_thin) look({}, 1, rows);
    if (which == 1) found = repeats_among(nearest, for_each);
    if (which == 2) in_heads = steps_in_heads(nearest.heads(), nearest.samples(), for_each);
    if (which == 3) spacing = spacing_of(samples.spacing);
    if (which == 4) sensor = find_sensor(nearest, sample);
  });
  int repeats = found.points;
  const auto thinned_samples = [&] {
    return from.take_samples_by({.stride = repeats}, for_noise.first(noise_queries(sample, repeats)), stop);
  };
  const double coordinate_step = in_heads.coarsest;
  const CoordinateSteps steps = coordinate_steps(std::move(in_heads), nearest, for_each);
  const bool is_plain = repeats == 1 && steps.at.empty();
  if (!is_plain || is_thin) {
    if (repeats > 1)
      samples = thinned_samples();
    else if (steps.kind != CoordinateSteps::Kind::depth && is_thin)
      samples = from.take_samples_by({.sheets = true}, for_noise, stop);
    cover_rounding(steps, samples.noise);
    look(steps, repeats, is_plain ? rows_of_hidden(nearest, samples.noise) : std::vector<Point>());
  }
  if (!seen.hidden.on_surface.empty()) {
    Estimate of_hidden{spacing, {}};
    add_hidden_surface(of_hidden, seen.hidden, sample, for_each);
    return of_hidden;
  }
  auto& [result, residuals, hidden] = seen;
  const double growth = repeats == 1 ? residual_growth(residuals).flat : kEndless;
  const bool is_small = result.noise.sigma < kMostFarNoise * result.noise.surface_spacing;
  const bool grows = growth > kCorrelatedGrowth[0] && growth < kEndless && is_small;
  const bool may_be_far = repeats == 1 ? grows : repeats < kMostRepeats;
  const int most_shared = int(std::min<std::uint64_t>(kMostRepeats, sample.bounds.valid / kLeastMeasurements));
  const bool is_shared_by_steps = repeats == 1 && result.noise.depth_has_steps && most_shared > 1;
  const auto is_shared_far = [&] {
    return most_shared == kMostRepeats && ((grows && errs_by_triangulation(residuals, nearest)) ||
                                           (may_be_far && is_correlated_far(from, for_noise, growth, stop)));
  };
  bool is_seen_shared = false;
  if (is_shared_by_steps || is_shared_far()) {
    Seen whole = seen;
    const int all_repeats = std::exchange(repeats, most_shared);
    samples = thinned_samples();
    cover_rounding(steps, samples.noise);
    look(steps, repeats, {});
    is_seen_shared = result.noise.depth_has_steps || neighbors_share_noise(nearest, result.noise.sigma, for_each);
    if (!is_seen_shared) {
      seen = std::move(whole);
      repeats = all_repeats;
    }
  }
  if (repeats == 1 && result.noise.gap == 0 && !result.noise.depth_has_steps) {
    Seen best = seen;
    const int first = is_dense(result.noise, 2) ? 16 : 4;  // spacings of every fourth point are twice as large
    for (int stride = first; stride <= kMostRepeats && is_dense(result.noise); stride *= 4) {
      samples = from.take_samples_by({.stride = stride}, first_samples, stop);
      cover_rounding(steps, samples.noise);
      look(steps, 1, {});
      if (!shows_noise_alone(seen)) continue;
      best = seen;
      best.estimate.noise.surface_spacing /= std::sqrt(stride);
    }
    seen = std::move(best);
  }
  result.spacing = spacing;
  Noise& noise = result.noise;
  const bool may_be_shared = noise.is_shared || repeats > kMostCopies * found.copies;
  noise.is_shared = noise.depth_has_steps || found.rows_share_errors ||
                    (may_be_shared && (is_seen_shared || neighbors_share_noise(nearest, noise.sigma, for_each)));
  noise.coordinate_step = coordinate_step;
  if (found.points == 1) result.sensor = std::move(sensor);  // else the nearest points are no steps of rays
  return result;
}

bool share_an_error(const CopiesFound& copies, const Noise& noise) {
  return copies.within <= kWithinCopies * std::max(noise.sigma, kSurelyCopies * noise.surface_spacing);
}

}  // namespace pointfair
