// SPDX-License-Identifier: Apache-2.0
// What estimates are made of, and which points of a tile are exact.
#include "cuda/backend.cuh"
#include "cuda/sampling/pools.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {

CloudSample CudaBackend::sample_cloud(std::size_t count) {
  context_.enter();
  wait_for_upload();
  CloudSample sample = sampler_.draw(uploaded_.data(), uploaded_.size(), count);
  clock_.pause();
  return sample;
}

void CudaBackend::sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) {
  context_.enter();
  DeviceArray<Index> asked(context_);
  DeviceArray<Point> rows(context_);
  rows.resize(out.size());
  asked.upload(queries, "uploading queries");
  first_.sample_neighborhoods({asked.data(), queries.size(), k, rows.data()});
  leaving_.copy(rows.data(), out);
  wait();
}

Samples CudaBackend::take_samples(std::span<const Index> for_spacing, std::span<const Index> for_noise,
                                  std::stop_token stop) {
  return samples_of(for_spacing, for_noise, {}, stop);
}

Samples CudaBackend::take_samples_by(SampleRule rule, std::span<const Index> for_noise, std::stop_token stop) {
  return samples_of({}, for_noise, rule, stop);
}

Samples CudaBackend::samples_of(std::span<const Index> for_spacing, std::span<const Index> for_noise, SampleRule rule,
                                const std::stop_token& stop) {
  throw_if_stopped(stop);
  context_.enter();
  const std::size_t spacings = for_spacing.size(), noises = for_noise.size();
  queries_.resize(spacings + noises);
  spacing_samples_.resize(spacings);
  noise_samples_.resize(noises);
  residual_samples_.resize(noises);
  const std::size_t pooled = noises <= kMostOfOne ? noises * point::kPool : 0;
  pools_.resize(pooled);
  const std::size_t near = rule.stride > 1 ? 0 : std::min(noises, std::size_t(point::kNearRows)) * point::kNearRow;
  near_.resize(near);
  std::copy(for_noise.begin(), for_noise.end(), std::copy(for_spacing.begin(), for_spacing.end(), queries_.get()));
  first_.take_samples({queries_.get(), spacings, noises, spacing_samples_.get(), noise_samples_.get(),
                       residual_samples_.get(), pooled > 0 ? pools_.get() : nullptr, near > 0 ? near_.get() : nullptr,
                       rule});
  wait();
  throw_if_stopped(stop);
  std::vector residuals(residual_samples_.get(), residual_samples_.get() + noises);
  return {{spacing_samples_.get(), spacing_samples_.get() + spacings},
          {noise_samples_.get(), noise_samples_.get() + noises},
          [residuals = std::move(residuals)] { return residuals; },
          {pools_.get(), pools_.get() + pooled},
          {{near_.get(), near_.get() + near}, point::kNearRow - 1}};
}

void CudaBackend::foresee_nearest(int count) {
  context_.enter();
  first_.foresee_nearest(count);
}

void CudaBackend::outcomes(const point::Region& loaded, std::span<unsigned char> out) {
  context_.enter();
  DeviceArray<unsigned char> found(context_);
  found.resize(out.size());
  first_.find_outcomes(loaded, found.data());
  found.download(out, "downloading outcomes");
  deliver();
  follow(copies_.all(), out);
}

}  // namespace pointfair::cuda
