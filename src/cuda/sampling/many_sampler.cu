// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <vector>

#include "cuda/sampling/many_sampler.cuh"
#include "cuda/sampling/pools.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {
namespace {

constexpr std::size_t kFartherAtOnce = 1 << 14;  // queries, of 7 KB each

}  // namespace

// Points, then their clouds, from a place in `queries_` on.
void ManySampler::upload(const ManyClouds::Queries& queries, std::size_t at) {
  const std::size_t count = queries.points.size();
  if (count == 0) return;
  const auto copy = [&](const std::vector<Index>& from, std::size_t to) {
    check(cudaMemcpyAsync(queries_.data() + to, from.data(), count * sizeof(Index), cudaMemcpyHostToDevice,
                          context_.stream()),
          "uploading queries");
  };
  copy(queries.points, at);
  copy(queries.clouds, at + count);
}

// A sample is copied with the bytes between its fields, which kernels do not write.
void ManySampler::clear_noise(std::size_t count) {
  noise_.resize(count);
  noise_.clear("clearing samples");
}

template <class T>
void ManySampler::fetch(const DeviceArray<T>& from, Pinned<T>& to) {
  to.resize(from.size());
  from.download({to.get(), from.size()}, "fetching samples");
}

ManyClouds::Taken ManySampler::take(const Tree& tree, const Point* points, std::size_t clouds,
                                    const ManyClouds::Queries& for_spacing, const ManyClouds::Queries& for_noise,
                                    const std::stop_token& stop) {
  const std::size_t spacings = for_spacing.points.size(), noises = for_noise.points.size();
  queries_.resize(2 * (spacings + noises));
  spacing_.resize(spacings);
  clear_noise(noises);
  residuals_.resize(noises);
  heads_.resize(noises * point::kHeadRow);
  upload(for_spacing, 0);
  upload(for_noise, 2 * spacings);
  const Index* const noise_queries = queries_.data() + 2 * spacings;
  take_samples(context_, tree, points,
               {queries_.data(), queries_.data() + spacings, spacings, noise_queries, noise_queries + noises, noises},
               {spacing_.data(), noise_.data(), residuals_.data(), heads_.data()});
  fetch(spacing_, fetched_spacing_);
  fetch(noise_, fetched_noise_);
  fetch(residuals_, fetched_residuals_);
  fetch(heads_, fetched_heads_);
  context_.finish();
  look_farther(tree, points, for_noise, stop);
  const bool pooled = find_pools(for_noise, clouds);
  return {{fetched_spacing_.get(), spacings},
          {fetched_noise_.get(), noises},
          {fetched_residuals_.get(), noises},
          {fetched_heads_.get(), noises * point::kHeadRow},
          {fetched_pools_.get(), pooled ? noises * point::kPool : 0}};
}

// False where a cloud has too many samples.
bool ManySampler::find_pools(const ManyClouds::Queries& for_noise, std::size_t clouds) {
  const std::size_t noises = for_noise.points.size();
  std::vector<Index> ends(clouds, 0);
  std::vector<std::uint8_t> shows(noises);
  for (std::size_t n = 0; n < noises; ++n) {
    ++ends[for_noise.clouds[n]];
    shows[n] = fetched_noise_.get()[n].shows_noise;
  }
  if (noises == 0 || *std::max_element(ends.begin(), ends.end()) > kMostPooled) return false;
  for (std::size_t cloud = 1; cloud < clouds; ++cloud) ends[cloud] += ends[cloud - 1];
  pools_.resize(noises * point::kPool);
  ends_.upload(ends, "pooling samples");
  shows_.upload(shows, "pooling samples");
  cuda::find_pools(context_, {ends_.data(), clouds, shows_.data(), heads_.data()}, pools_.data());
  fetch(pools_, fetched_pools_);
  context_.finish();
  return true;
}

// Those whose first rows were too short.
void ManySampler::look_farther(const Tree& tree, const Point* points, const ManyClouds::Queries& for_noise,
                               const std::stop_token& stop) {
  point::NoiseSample* const noise = fetched_noise_.get();
  std::vector<std::size_t> short_ones;
  for (std::size_t n = 0; n < for_noise.points.size(); ++n)
    if (noise[n].is_short) short_ones.push_back(n);
  std::vector<point::NoiseSample> found;
  for (std::size_t first = 0; first < short_ones.size(); first += kFartherAtOnce) {
    throw_if_stopped(stop);
    const std::size_t count = std::min(kFartherAtOnce, short_ones.size() - first);
    ManyClouds::Queries queries;
    for (std::size_t n = first; n < first + count; ++n) {
      queries.points.push_back(for_noise.points[short_ones[n]]);
      queries.clouds.push_back(for_noise.clouds[short_ones[n]]);
    }
    upload(queries, 0);
    clear_noise(count);
    cuda::look_farther(context_, tree, points, queries_.data(), queries_.data() + count, count, noise_.data());
    found.resize(count);
    noise_.download(found, "fetching samples");
    context_.finish();
    for (std::size_t n = 0; n < count; ++n) noise[short_ones[first + n]] = found[n];
  }
}

}  // namespace pointfair::cuda
