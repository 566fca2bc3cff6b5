// SPDX-License-Identifier: Apache-2.0
#include "estimate/hidden_surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"

namespace pointfair {
namespace {

using namespace constants;

constexpr std::size_t kNearest = 16, kHalf = kNearest / 2, kRow = 2 * kNearest;
using Offsets = std::span<const point::Offset, kNearest>;

// Of a row, other than the sample's own, by distance; points at one place follow each other.
std::vector<point::Offset> distinct_places(const Point* row) {
  std::vector<point::Offset> places;
  point::Offset before{0, 0, 0};
  for (std::size_t i = 1; i <= kRow && !std::isnan(row[i].x); ++i) {
    const point::Offset o = point::offset_between(row[0], row[i]);
    if (o.x == before.x && o.y == before.y && o.z == before.z) continue;
    places.push_back(before = o);
  }
  return places;
}

// Standard deviation of the sample and those within `most` of the plane through it, over their own plane; endless where
// they lie along a line, as points of one row do.
double deviation_of(Offsets offsets, const point::Offset& normal, double most) {
  point::Terms<point::kMoments> sums{};
  double n = 1;  // the sample adds nothing to the sums
  for (const point::Offset& o : offsets) {
    if (std::abs(dot(o, normal)) > most) continue;
    const point::Terms<point::kMoments> its = point::moments(o, 1);
    for (std::size_t i = 0; i < point::kMoments; ++i) sums.of[i] += its.of[i];
    ++n;
  }
  const point::Plane plane = point::plane_of(sums, n);
  return plane.exists && plane.roundness >= point::kRound ? std::sqrt(plane.variance * n / (n - 3)) : kEndless;
}

// Half of the nearest points, which lie nearly in one plane.
struct Half {
  double noise = kEndless;  // how far they lie off it
  point::Offset normal{0, 0, 0};
};

// Of the planes through a sample and two of its nearest points, the one that half of these are nearest to (least median
// of squares, Rousseeuw 1984).
Half best_half(Offsets offsets) {
  Half result;
  double least = kEndless;
  std::array<double, kNearest> x, y, z;
  for (std::size_t i = 0; i < kNearest; ++i) x[i] = offsets[i].x, y[i] = offsets[i].y, z[i] = offsets[i].z;
  for (std::size_t a = 1; a < kNearest; ++a)
    for (std::size_t b = 0; b < a; ++b) {
      const point::Offset across = cross(offsets[a], offsets[b]);
      const double squared_size = dot(across, across), squared_least = least * least * squared_size;
      if (!(squared_size > 0)) continue;
      double nearer = 0;  // than half of them are to the best plane so far
      for (std::size_t i = 0; i < kNearest; ++i) {
        const double height = x[i] * across.x + y[i] * across.y + z[i] * across.z;
        nearer += height * height < squared_least ? 1.0 : 0.0;
      }
      if (nearer < double(kHalf)) continue;
      const point::Offset normal = (1 / std::sqrt(squared_size)) * across;
      std::array<double, kNearest> heights;
      for (std::size_t i = 0; i < kNearest; ++i) heights[i] = std::abs(dot(offsets[i], normal));
      std::nth_element(heights.begin(), heights.begin() + (kHalf - 1), heights.end());
      const double deviation = deviation_of(offsets, normal, heights[kHalf - 1]);
      if (deviation == kEndless) continue;
      least = heights[kHalf - 1];
      result = {deviation, normal};
    }
  return result;
}

// A sample through which there may be a surface.
struct Found {
  std::size_t sample;
  Point at;
  Half half;
  std::size_t further, further_met;  // points beyond the nearest; those that lie near the plane
};

std::optional<Found> surface_at(std::size_t sample, const Point* row) {
  const std::vector<point::Offset> places = distinct_places(row);
  if (places.size() < kNearest) return std::nullopt;
  const Half half = best_half(std::span(places).first<kNearest>());
  const double size = point::length(places[kNearest - 1]);
  if (!(half.noise < kHiddenNoise * size)) return std::nullopt;
  const auto met = std::count_if(places.begin() + kNearest, places.end(), [&](const point::Offset& o) {
    return std::abs(dot(o, half.normal)) < kFurtherNoise * kHiddenNoise * size;
  });
  return Found{sample, row[0], half, places.size() - kNearest, std::size_t(met)};
}

// Half of sixteen points lie in a plane by chance here and there, but further ones then do not.
bool further_points_agree(const std::vector<Found>& found) {
  std::size_t further = 0, met = 0;
  for (const Found& one : found) further += one.further, met += one.further_met;
  return double(met) >= kFurtherShare * double(further);
}

// Whether most planes meet the nearest other place that has one, as those of one surface do. What a scanner saw in one
// turn lies in a plane, too, however large its noise along the beam is; but the planes of other turns pass it by.
bool meet_each_other(const std::vector<Found>& found) {
  std::size_t meeting = 0;
  for (const Found& one : found) {
    point::Offset nearest{0, 0, 0};
    double squared = kEndless;
    for (const Found& other : found) {
      const point::Offset o = point::offset_between(one.at, other.at);
      if (other.sample == one.sample || !(point::squared_length(o) < squared)) continue;
      squared = point::squared_length(o);
      nearest = o;
    }
    const double height = dot(nearest, one.half.normal);
    meeting += height * height < kSameSurface * kSameSurface * squared ? 1 : 0;
  }
  return 2 * meeting > found.size();
}

// Whether the nearest points may hide a surface.
bool is_messy(const point::NoiseSample& sample) {
  return sample.shows_noise && sample.sigma > kMessyNoise * sample.spacing;
}

}  // namespace

std::vector<Point> rows_of_hidden(const NearestRows& rows, std::span<const point::NoiseSample> samples) {
  const std::size_t looked_at = std::min(rows.looked_at(), samples.size());
  const auto messy = std::count_if(samples.begin(), samples.begin() + std::ptrdiff_t(looked_at), is_messy);
  return 2 * std::size_t(messy) < looked_at ? std::vector<Point>() : rows.of(looked_at, int(kRow));
}

HiddenSurface find_hidden_surface(std::span<const Point> rows, std::vector<point::NoiseSample> samples,
                                  const ForEach& for_each) {
  const std::size_t looked_at = rows.size() / (kRow + 1);
  std::vector<std::optional<Found>> at_samples(looked_at);
  for_each(looked_at, [&](std::size_t i) {
    if (is_messy(samples[i])) at_samples[i] = surface_at(i, &rows[i * (kRow + 1)]);
  });
  std::vector<Found> found;
  for (const std::optional<Found>& one : at_samples)
    if (one) found.push_back(*one);
  const bool is_chance = found.size() < std::max(kFewestHidden, std::size_t(kHiddenShare * double(looked_at))) ||
                         !further_points_agree(found) || !meet_each_other(found);
  if (is_chance) return {};
  std::vector<bool> on_surface(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i)
    on_surface[i] = (i < looked_at && at_samples[i]) || !is_messy(samples[i]);
  if (2 * std::size_t(std::ranges::count(on_surface, true)) > samples.size()) return {};
  for (const Found& one : found) samples[one.sample].sigma = one.half.noise;
  return {std::move(on_surface), std::move(samples)};
}

HiddenSurface find_quiet_surface(const std::vector<point::NoiseSample>& samples,
                                 const std::function<std::vector<point::ResidualSample>()>& residuals) {
  std::size_t quiet = 0, between = 0, messy = 0;
  for (const point::NoiseSample& sample : samples) {
    if (!sample.shows_noise) continue;
    ++(is_messy(sample) ? messy : sample.sigma < kQuietNoise * sample.spacing ? quiet : between);
  }
  const std::size_t fewest = std::max(kFewestHidden, std::size_t(kHiddenShare * double(samples.size())));
  if (messy < samples.size() / 2 || quiet < fewest || double(between) > kMostBetween * double(quiet)) return {};
  std::vector<double> narrow, widest;
  const std::vector<point::ResidualSample> of_samples = residuals();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!is_messy(samples[i]) || of_samples[i].narrow < 0 || of_samples[i].widest < 0) continue;
    narrow.push_back(of_samples[i].narrow);
    widest.push_back(of_samples[i].widest);
  }
  if (narrow.empty() || median(std::move(widest)) < kGrowthOfVolume * median(std::move(narrow))) return {};
  HiddenSurface result{std::vector<bool>(samples.size()), samples};
  for (std::size_t i = 0; i < samples.size(); ++i) result.on_surface[i] = !is_messy(samples[i]);
  return result;
}

}  // namespace pointfair
