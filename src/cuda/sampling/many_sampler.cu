// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <vector>

#include "cuda/sampling/many_sampler.cuh"

namespace pointfair::cuda {
namespace {

constexpr std::size_t kFartherAtOnce = 1 << 14;  // queries, of 7 KB each

void stop_if_asked(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
}

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

template <class T>
void ManySampler::fetch(const DeviceArray<T>& from, T* to) {
  if (from.size() == 0) return;
  check(cudaMemcpyAsync(to, from.data(), from.size() * sizeof(T), cudaMemcpyDeviceToHost, context_.stream()),
        "fetching samples");
}

void ManySampler::take(const Tree& tree, const Point* points, const ManyClouds::Queries& for_spacing,
                       const ManyClouds::Queries& for_noise, const ManySamples& to, const std::stop_token& stop) {
  const std::size_t spacings = for_spacing.points.size(), noises = for_noise.points.size();
  queries_.resize(2 * (spacings + noises));
  spacing_.resize(spacings);
  noise_.resize(noises);
  residuals_.resize(noises);
  heads_.resize(noises * point::kHeadRow);
  upload(for_spacing, 0);
  upload(for_noise, 2 * spacings);
  const Index* const noise_queries = queries_.data() + 2 * spacings;
  take_samples(context_, tree, points,
               {queries_.data(), queries_.data() + spacings, spacings, noise_queries, noise_queries + noises, noises},
               {spacing_.data(), noise_.data(), residuals_.data(), heads_.data()});
  fetch(spacing_, to.spacing);
  fetch(noise_, to.noise);
  fetch(residuals_, to.residuals);
  fetch(heads_, to.heads);
  context_.finish();
  look_farther(tree, points, for_noise, to.noise, stop);
}

// Those whose first rows were too short.
void ManySampler::look_farther(const Tree& tree, const Point* points, const ManyClouds::Queries& for_noise,
                               point::NoiseSample* noise, const std::stop_token& stop) {
  std::vector<std::size_t> short_ones;
  for (std::size_t n = 0; n < for_noise.points.size(); ++n)
    if (noise[n].is_short) short_ones.push_back(n);
  std::vector<point::NoiseSample> found;
  for (std::size_t first = 0; first < short_ones.size(); first += kFartherAtOnce) {
    stop_if_asked(stop);
    const std::size_t count = std::min(kFartherAtOnce, short_ones.size() - first);
    ManyClouds::Queries queries;
    for (std::size_t n = first; n < first + count; ++n) {
      queries.points.push_back(for_noise.points[short_ones[n]]);
      queries.clouds.push_back(for_noise.clouds[short_ones[n]]);
    }
    upload(queries, 0);
    noise_.resize(count);
    cuda::look_farther(context_, tree, points, queries_.data(), queries_.data() + count, count, noise_.data());
    found.resize(count);
    fetch(noise_, found.data());
    context_.finish();
    for (std::size_t n = 0; n < count; ++n) noise[short_ones[first + n]] = found[n];
  }
}

}  // namespace pointfair::cuda
