// SPDX-License-Identifier: Apache-2.0
#include "estimate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "share_between.hpp"
#include "surface_fit.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kSpacingSamples = 2000, kNoiseSamples = 500;
constexpr int kSpacingNeighbors = 6;
constexpr std::size_t kFirstFit = 30;
constexpr double kFitGrowth = 1.4;
constexpr double kSheetShare = 0.1;  // of the samples; fewer that see two sheets are corners and outliers
// Rows are asked for in two lengths: a row of the nearest begins with every shorter one, so each serves several rounds
// of growth. The first is a round's size (30 times 1.4^4).
constexpr int kFitRows[] = {115, int(kLargestFit)};
constexpr double kDoubtfulNoise = 0.6;  // spacings; below it residuals may be shape
// How residuals grow from one neighbourhood to one of twice the points where they are noise, where they are shape.
constexpr double kNoiseGrowth = 1.35, kShapeGrowth = 1.5;
// The same of the medians: of noise alone (fewer points scatter more), and of the variances of shape.
constexpr double kOwnGrowth = 1.05, kShapeVarianceGrowth = 4;
constexpr double kNearFlat = 2;  // of the flattest places' residual; larger ones are beyond the similarity sigma
constexpr double kEndless = 1e9;
// Noise that is alike in neighbouring points: how much residuals grow even in the flattest places (1.09 is chance), the
// variance at most (more is shape), what it grows then over that (more is shape), and the noise in spacings.
constexpr double kAlikeGrowth[] = {1.14, 1.18}, kUnlikeGrowth[] = {1.5, 1.0};
constexpr double kAlikeSlowing[] = {1.2, 0.9}, kAlikeNoise[] = {0.05, 0.1};

// Scattered over the upload order by a low-discrepancy sequence (multiples of the golden ratio), so that a period in
// the order of the file (rows of a scanner) is not met in step.
std::vector<std::uint32_t> sample_queries(std::uint64_t points, std::size_t samples) {
  std::vector<std::uint32_t> queries;
  if (points <= samples) {
    for (std::uint64_t i = 0; i < points; ++i) queries.push_back(std::uint32_t(i));
    return queries;
  }
  constexpr double kGolden = 0.6180339887498949;
  for (std::size_t i = 0; i < samples; ++i) {
    const double place = double(i + 1) * kGolden;
    queries.push_back(std::uint32_t((place - std::floor(place)) * double(points)));
  }
  return queries;
}

void throw_if_stopped(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
}

Offset operator-(Point a, Point b) {
  return {double(a.x) - double(b.x), double(a.y) - double(b.y), double(a.z) - double(b.z)};
}

// The known part of a row of sample_neighborhoods, relative to its query; empty if the query is invalid.
std::vector<Offset> offsets_of(std::span<const Point> row) {
  std::vector<Offset> offsets;
  offsets.reserve(row.size());
  for (const Point& p : row.subspan(1)) {
    if (std::isnan(p.x)) break;
    offsets.push_back(p - row[0]);
  }
  return offsets;
}

// What the nearest points of a query show.
struct Sight {
  bool is_short = false;  // all of them are not enough, but more could be
  bool shows_noise = false;
  double sigma = 0, spacing = 0, gap = 0;  // if so
};

// The neighbourhood grows until it is wide against the noise. `asked`: how many points there should be; up to `known`
// it was not wide.
Sight local_noise(std::span<const Offset> offsets, std::size_t known, std::size_t asked) {
  GrowingNeighborhood neighborhood(offsets);
  for (double wanted = kFirstFit;; wanted *= kFitGrowth) {
    const std::size_t k = std::min(std::min(std::size_t(wanted), kLargestFit), offsets.size());
    if (k <= known && k < offsets.size()) continue;
    neighborhood.grow_to(k);
    if (neighborhood.is_wide() || k == kLargestFit || offsets.size() < std::min(asked, std::size_t(wanted))) {
      if (!neighborhood.shows_a_surface()) return {};
      return {false, true, neighborhood.noise(), neighborhood.spacing(), neighborhood.gap()};
    }
    if (k == asked) return {true};
  }
}

double quantile(std::vector<double> values, double share) {
  const auto place = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

}  // namespace

std::vector<Point> curve_sample(std::span<const Point> points) {
  constexpr std::size_t kAll = 2048, kSample = 256;  // a small cloud's cube does not depend on the order of its points
  const std::size_t count = points.size() <= kAll ? points.size() : kSample;
  std::vector<Point> sample;
  for (std::size_t i = 0; i < count; ++i) sample.push_back(points[i * points.size() / count]);
  return sample;
}

CurveCube curve_cube(std::span<const Point> sample) {
  const auto is_indexed = [](float coordinate) { return std::abs(coordinate) < 1e18f; };
  std::array<std::vector<double>, 3> axes;
  for (const Point& p : sample) {
    if (!is_indexed(p.x) || !is_indexed(p.y) || !is_indexed(p.z)) continue;
    axes[0].push_back(p.x);
    axes[1].push_back(p.y);
    axes[2].push_back(p.z);
  }
  if (axes[0].empty()) return {};
  std::array<double, 3> low{};
  double side = 0, widest = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = quantile(axes[a], 0.02);
    side = std::max(side, quantile(axes[a], 0.98) - low[a]);
    const auto [least, most] = std::minmax_element(axes[a].begin(), axes[a].end());
    widest = std::max(widest, *most - *least);
  }
  if (!(side > 0)) side = widest;  // nearly all in one place
  if (!(side > 0)) return {{float(low[0]), float(low[1]), float(low[2])}, 0};
  // On a grid that small moves hardly change, so that a pass on its own and as one of several order sums alike. From a
  // quarter of the side below the sample to a quarter above are inside wherever the grid lies.
  const double power = std::exp2(std::ceil(std::log2(1.75 * side))), step = power / 8;
  for (double& l : low) l = std::floor((l - side / 4) / step) * step;
  return {{float(low[0]), float(low[1]), float(low[2])}, float(power)};
}

Spacing measure_spacing(Backend& backend, std::uint64_t points, const std::stop_token& stop) {
  throw_if_stopped(stop);
  const std::vector<std::uint32_t> queries = sample_queries(points, kSpacingSamples);
  std::vector<Point> rows(queries.size() * (kSpacingNeighbors + 1));
  backend.sample_neighborhoods(queries, kSpacingNeighbors, rows);
  std::vector<double> means(queries.size(), -1), last(queries.size(), -1);  // of valid ones
  backend.for_each_on_host(queries.size(), [&](std::size_t q) {
    const Point* const row = rows.data() + q * (kSpacingNeighbors + 1);
    double total = 0;
    int found = 0;
    for (; found < kSpacingNeighbors && !std::isnan(row[found + 1].x); ++found)
      total += last[q] = length(row[found + 1] - row[0]);
    if (found > 0) means[q] = total / found;
  });
  const auto is_invalid = [](double value) { return value < 0; };
  std::erase_if(means, is_invalid);
  std::erase_if(last, is_invalid);
  if (last.empty()) return {};
  // without the loneliest 2 %: a stray point's distance is no spacing
  const auto lonely = means.end() - std::ptrdiff_t(means.size() / 50);
  std::nth_element(means.begin(), lonely, means.end());
  means.erase(lonely, means.end());
  return {std::accumulate(means.begin(), means.end(), 0.0) / double(means.size()), quantile(last, 0.95)};
}

namespace {

// How residuals grow from neighbourhoods of some points to those of twice as many: hardly where they are noise.
struct Growth {
  double flat = 1, typical = 1;  // of the 15 % quantiles and of the medians
  double first = 0, second = 0;  // of the mean variance in flat places, less one; from there to twice as many again
};

Growth residual_growth(Backend& backend, std::span<const Point> rows, std::size_t row, const std::stop_token& stop) {
  const std::size_t samples = rows.size() / row;
  std::vector<double> narrow(samples, -1), wide(samples, -1), widest(samples, -1);
  backend.for_each_on_host(samples, [&](std::size_t q) {
    throw_if_stopped(stop);
    const auto offsets = offsets_of(rows.subspan(q * row, row));
    if (offsets.size() < 2 * kFirstFit) return;
    GrowingNeighborhood neighborhood(offsets);
    const auto noise_of_first = [&](std::size_t n) {
      neighborhood.grow_to(n);
      return neighborhood.shows_a_surface() ? neighborhood.noise() : -1;
    };
    narrow[q] = noise_of_first(kFirstFit);
    wide[q] = noise_of_first(2 * kFirstFit);
    if (offsets.size() + 1 == row) widest[q] = noise_of_first(offsets.size());
  });
  const auto growth_at = [&](double share, double most) {
    std::vector<double> from, to;
    for (std::size_t q = 0; q < samples; ++q) {
      if (narrow[q] < 0 || wide[q] < 0 || narrow[q] > most) continue;
      from.push_back(narrow[q]);
      to.push_back(wide[q]);
    }
    if (from.empty()) return 1.0;
    const double low = quantile(from, share), high = quantile(to, share);
    return low > 0 ? high / low : high > 0 ? kEndless : 1;
  };
  std::vector<double> known = narrow;
  std::erase_if(known, [](double s) { return s < 0; });
  if (known.empty()) return {};
  const double near_flat = kNearFlat * quantile(known, 0.15);
  Growth growth{growth_at(0.15, kEndless), growth_at(0.5, near_flat)};
  double variance[3] = {};
  for (std::size_t q = 0; q < samples; ++q) {
    if (narrow[q] < 0 || wide[q] < 0 || widest[q] < 0) continue;
    if (narrow[q] > near_flat || widest[q] > kNearFlat * near_flat) continue;
    variance[0] += narrow[q] * narrow[q];
    variance[1] += wide[q] * wide[q];
    variance[2] += widest[q] * widest[q];
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
  const auto share = [](const double(&ends)[2], double value) { return share_between(ends[0], ends[1], value); };
  if (!(growth.first > 0)) return 0;
  return share(kAlikeGrowth, growth.flat) * share(kUnlikeGrowth, growth.first) *
         share(kAlikeSlowing, growth.second / growth.first) * share(kAlikeNoise, sigma_in_spacings);
}

double likeness_to_shape(double flat_growth) { return share_between(kNoiseGrowth, kShapeGrowth, flat_growth); }

// Variances of noise stay, those of shape grow fourfold: g^2 = (1 + 4 x) / (1 + x).
double shape_to_noise(double typical_growth) {
  const double squared = typical_growth * typical_growth / (kOwnGrowth * kOwnGrowth);
  if (squared >= kShapeVarianceGrowth) return kEndless;
  return std::max(0.0, (squared - 1) / (kShapeVarianceGrowth - squared));
}

}  // namespace

Noise measure_noise(Backend& backend, std::uint64_t points, const std::stop_token& stop) {
  std::vector<std::uint32_t> queries = sample_queries(points, kNoiseSamples);
  std::vector<double> sigmas, spacings, gaps;
  std::unique_ptr<Point[]> first_rows;
  const std::size_t samples = queries.size();
  std::size_t known = 0;
  for (const int k : kFitRows) {
    throw_if_stopped(stop);
    const std::size_t row = std::size_t(k) + 1;
    auto rows = std::make_unique_for_overwrite<Point[]>(queries.size() * row);  // megabytes, all written below
    backend.sample_neighborhoods(queries, k, {rows.get(), queries.size() * row});
    std::vector<Sight> found(queries.size());
    backend.for_each_on_host(queries.size(), [&](std::size_t q) {
      throw_if_stopped(stop);
      const auto offsets = offsets_of({rows.get() + q * row, row});
      if (offsets.size() >= kFirstFit / 2) found[q] = local_noise(offsets, known, std::size_t(k));
    });
    std::vector<std::uint32_t> again;
    for (std::size_t q = 0; q < queries.size(); ++q) {
      if (found[q].is_short) again.push_back(queries[q]);
      if (!found[q].shows_noise) continue;
      sigmas.push_back(found[q].sigma);
      spacings.push_back(found[q].spacing);
      if (found[q].gap > 0) gaps.push_back(found[q].gap);
    }
    if (first_rows == nullptr) first_rows = std::move(rows);
    queries = std::move(again);
    if (queries.empty()) break;
    known = std::size_t(k);
  }
  if (sigmas.empty()) return {};
  // Where noise is all there is, residuals spread little; where curvature adds to them, the least ones know more.
  const double sigma = std::min(quantile(sigmas, 0.35), 1.2 * quantile(sigmas, 0.15));
  Noise noise{sigma, quantile(spacings, 0.5)};
  if (double(gaps.size()) > kSheetShare * double(sigmas.size())) noise.gap = quantile(gaps, 0.25);
  if (sigma < kDoubtfulNoise * noise.surface_spacing) {
    const std::size_t row = std::size_t(kFitRows[0]) + 1;
    const Growth growth = residual_growth(backend, {first_rows.get(), samples * row}, row, stop);
    noise.likeness_to_shape = likeness_to_shape(growth.flat);
    noise.alikeness = alikeness(growth, sigma / noise.surface_spacing);
    // between two sheets, wide neighbourhoods see the other one and not shape
    if (noise.gap == 0) noise.shape_to_noise = (1 - noise.alikeness) * shape_to_noise(growth.typical);
  }
  return noise;
}

}  // namespace pointfair
