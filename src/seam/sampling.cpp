// SPDX-License-Identifier: Apache-2.0
// The default bodies of Sampling: fits of rows of nearest points on the host's cores.
#include "seam/sampling.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "seam/sample_fits.hpp"
#include "seam/stop.hpp"

namespace pointfair {
namespace {

// The rows of `queries`, one after the other: each of them and every `stride`-th of its nearest, k of these. Megabytes,
// all written at once.
std::shared_ptr<Point[]> rows_of(Sampling& from, std::span<const std::uint32_t> queries, int k, int stride,
                                 const std::stop_token& stop) {
  throw_if_stopped(stop);
  const std::size_t kept = std::size_t(k) + 1, size = queries.size() * kept;
  auto rows = std::make_shared_for_overwrite<Point[]>(size);
  if (queries.empty()) return rows;
  if (stride == 1) {
    from.sample_neighborhoods(queries, k, {rows.get(), size});
    return rows;
  }
  constexpr std::size_t kAtOnce = 512;
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  const int nearest = std::min(k * stride, Sampling::kLongestRow);
  const std::size_t there = std::size_t(nearest / stride) + 1;
  std::vector<Point> whole(std::min(kAtOnce, queries.size()) * (std::size_t(nearest) + 1));
  for (std::size_t first = 0; first < queries.size(); first += kAtOnce) {
    throw_if_stopped(stop);
    const auto some = queries.subspan(first, std::min(kAtOnce, queries.size() - first));
    const std::span all = std::span(whole).first(some.size() * (std::size_t(nearest) + 1));
    from.sample_neighborhoods(some, nearest, all);
    for (std::size_t q = 0; q < some.size(); ++q)
      for (std::size_t i = 0; i < kept; ++i)
        rows[(first + q) * kept + i] =
            i < there ? all[q * (std::size_t(nearest) + 1) + i * std::size_t(stride)] : Point{kNaN, kNaN, kNaN};
  }
  return rows;
}

// The first points of the first rows, of so many points each.
NearRows near_rows(const Point* rows, std::size_t count, std::size_t row) {
  NearRows near{{}, point::kNearRow - 1};
  for (std::size_t q = 0; q < std::min(count, std::size_t(point::kNearRows)); ++q)
    near.points.insert(near.points.end(), rows + q * row, rows + q * row + point::kNearRow);
  return near;
}

}  // namespace

void Sampling::for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) {
  tbb::parallel_for(std::size_t(0), count, body);
}

Samples Sampling::take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                               std::stop_token stop) {
  using namespace point;
  std::vector<SpacingSample> spacing(for_spacing.size());
  const auto rows = rows_of(*this, for_spacing, kSpacingNeighbors, 1, stop);
  for_each_on_host(for_spacing.size(),
                   [&](std::size_t q) { spacing[q] = spacing_sample(rows.get() + q * (kSpacingNeighbors + 1)); });
  Samples samples = Sampling::take_samples_by({}, for_noise, std::move(stop));
  samples.spacing = std::move(spacing);
  return samples;
}

Samples Sampling::take_samples_by(SampleRule rule, std::span<const std::uint32_t> for_noise, std::stop_token stop) {
  using namespace point;
  Samples samples;
  samples.noise.resize(for_noise.size());

  const SampleFits& fits = sample_fits();
  const auto first_rows = rows_of(*this, for_noise, kFirstRow, rule.stride, stop);
  if (rule.stride == 1) samples.near = near_rows(first_rows.get(), for_noise.size(), kFirstRow + 1);
  for_each_on_host(for_noise.size(), [&](std::size_t q) {
    throw_if_stopped(stop);
    samples.noise[q] = fits.first_rounds(&first_rows[q * (kFirstRow + 1)].x, rule.sheets);
  });
  samples.residuals = [this, &fits, first_rows, rule, stop, count = for_noise.size(),
                       known = std::make_shared<std::vector<ResidualSample>>()] {
    if (known->size() < count) {
      std::vector<ResidualSample> residuals(count);
      for_each_on_host(count, [&](std::size_t q) {
        throw_if_stopped(stop);
        residuals[q] = fits.residuals(&first_rows[q * (kFirstRow + 1)].x, rule.sheets);
      });
      *known = std::move(residuals);
    }
    return *known;
  };

  std::vector<std::size_t> short_ones;
  std::vector<std::uint32_t> queries;
  for (std::size_t q = 0; q < for_noise.size(); ++q) {
    if (!samples.noise[q].is_short) continue;
    short_ones.push_back(q);
    queries.push_back(for_noise[q]);
  }
  const auto last_rows = rows_of(*this, queries, kLastRow, rule.stride, stop);
  for_each_on_host(queries.size(), [&](std::size_t n) {
    throw_if_stopped(stop);
    samples.noise[short_ones[n]] = fits.last_rounds(&last_rows[n * (kLastRow + 1)].x, rule.sheets);
  });
  return samples;
}

std::vector<double> Sampling::beyond_two(std::span<const std::uint32_t> queries, std::span<const double> sigmas,
                                         const std::stop_token& stop) {
  using namespace point;
  std::vector<double> shares(queries.size());
  const auto rows = rows_of(*this, queries, kLastRow, 1, stop);
  for_each_on_host(queries.size(), [&](std::size_t q) {
    throw_if_stopped(stop);
    shares[q] = sample_fits().beyond_two(&rows[q * (kLastRow + 1)].x, sigmas[q]);
  });
  return shares;
}

}  // namespace pointfair
