// SPDX-License-Identifier: Apache-2.0
#include "estimate/hidden_surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>

#include "estimate/constants.hpp"
#include "estimate/quantile.hpp"

namespace pointfair {
namespace {

using namespace constants;

constexpr std::size_t kNearest = 16, kHalf = kNearest / 2, kRow = 2 * kNearest;
using Offsets = std::array<point::Offset, kNearest>;

// Of a row, other than the sample's own; points at one place follow each other. None where there are fewer.
std::optional<Offsets> distinct_places(const Point* row) {
  Offsets offsets;
  std::size_t found = 0;
  point::Offset before{0, 0, 0};
  for (std::size_t i = 1; i <= kRow && found < kNearest && !std::isnan(row[i].x); ++i) {
    const point::Offset o = point::offset_between(row[0], row[i]);
    if (o.x == before.x && o.y == before.y && o.z == before.z) continue;
    before = offsets[found++] = o;
  }
  if (found < kNearest) return std::nullopt;
  return offsets;
}

// Standard deviation of the sample and those within `most` of the plane through it, over their own plane; endless where
// they lie along a line, as points of one row do.
double deviation_of(const Offsets& offsets, const point::Offset& normal, double most) {
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

// Of the planes through a sample and two of its nearest points, the one that half of these are nearest to (least median
// of squares, Rousseeuw 1984): how far they lie off it.
double noise_of_best_half(const Offsets& offsets) {
  double least = kEndless, result = kEndless;
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
      result = deviation;
    }
  return result;
}

}  // namespace

std::vector<bool> find_hidden_surface(NearestRows& rows, std::vector<point::NoiseSample>& samples,
                                      const ForEach& for_each) {
  const std::size_t looked_at = std::min(rows.looked_at(), samples.size());
  const auto is_messy = [](const point::NoiseSample& s) { return s.shows_noise && s.sigma > kMessyNoise * s.spacing; };
  const auto messy = std::count_if(samples.begin(), samples.begin() + std::ptrdiff_t(looked_at), is_messy);
  if (2 * std::size_t(messy) < looked_at) return {};  // the surface is there for all to see
  const std::vector<Point> nearest = rows.of(looked_at, int(kRow));
  std::vector<double> found(looked_at, kEndless), hidden;
  for_each(looked_at, [&](std::size_t i) {
    const std::optional<Offsets> offsets =
        is_messy(samples[i]) ? distinct_places(&nearest[i * (kRow + 1)]) : std::nullopt;
    if (!offsets) return;
    const double noise = noise_of_best_half(*offsets);
    if (noise < kHiddenNoise * point::length(offsets->back())) found[i] = noise;
  });
  std::copy_if(found.begin(), found.end(), std::back_inserter(hidden), [](double noise) { return noise < kEndless; });
  if (hidden.size() < std::max(kFewestHidden, std::size_t(kHiddenShare * double(looked_at)))) return {};
  const double typical = median(std::move(hidden));
  std::vector<bool> on_surface(samples.size(), true);
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (i >= looked_at || found[i] == kEndless)
      on_surface[i] = !(is_messy(samples[i]) && samples[i].sigma > kNoSurface * typical);
  if (2 * std::count(on_surface.begin(), on_surface.end(), true) > std::ptrdiff_t(samples.size())) return {};
  for (std::size_t i = 0; i < looked_at; ++i)
    if (found[i] < kEndless) samples[i].sigma = found[i];
  return on_surface;
}

}  // namespace pointfair
