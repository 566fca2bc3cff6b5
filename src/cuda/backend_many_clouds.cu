// SPDX-License-Identifier: Apache-2.0
// Many clouds at once, as a batch.
#include "cuda/backend.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {

void CudaBackend::upload(std::span<const Point> points, std::span<const Index> ends) {
  context_.enter();
  forget_cloud(points.size());
  uploaded_.resize(points.size());
  staging_.upload(points, uploaded_.data(), context_.stream());
  build_batch_index(ends);
}

void CudaBackend::upload(const DevicePoints& points, DeviceStream stream, std::span<const Index> ends) {
  context_.enter();
  require_on_card(points.data, points.count, points.type, points.card, card_);
  forget_cloud(points.count);
  let_wait(stream);
  callers_.take(points, {}, uploaded_.data());
  build_batch_index(ends);
}

std::vector<std::uint8_t> CudaBackend::surely_have_no_origin(const DevicePoints& points, DeviceStream stream,
                                                             std::span<const Index> ends) {
  context_.enter();
  require_on_card(points.data, points.count, points.type, points.card, card_);
  let_wait(stream);
  ends_.upload(ends, "uploading clouds");
  return cuda::surely_have_no_origin(context_, points, ends_.data(), ends.size());
}

ManyClouds::Taken CudaBackend::take_samples(const Queries& for_spacing, const Queries& for_noise,
                                            std::stop_token stop) {
  throw_if_stopped(stop);
  context_.enter();
  const Taken taken =
      many_samples_.take(first_.sampled_tree(), first_.input(), clouds_.size(), for_spacing, for_noise, stop);
  clock_.pause();
  return taken;
}

void CudaBackend::run(std::span<const Index> clouds, std::span<const FramedSettings> settings, int iterations,
                      std::stop_token stop) {
  context_.enter();
  context_.finish();  // with the nodes of clouds before
  FramedSettings common = settings[0];
  common.neighbors.levels.reset();
  common.neighbors.reach_levels.reset();
  for (const FramedSettings& its : settings)
    common.neighbors.min_neighbors = std::max(common.neighbors.min_neighbors, its.neighbors.min_neighbors);
  batch_ = batch_storage_.plan(clouds_, clouds, settings, uploaded_.size(), on_host());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    if (iteration == 0) {
      first_.build_index(uploaded_.data(), *batch_, stop);
    } else {
      build_index(iteration, std::nullopt, stop);
    }
    find_neighbors(iteration, common.neighbors, stop);
    estimate_normals(iteration, common.normals, stop);
    common.fairing.is_further = iteration > 0;
    fair(iteration, common.fairing, stop);
  }
  if (limited_.size() == 0) {
    limited_.resize(uploaded_.size());
    check(cudaMemcpyAsync(limited_.data(), uploaded_.data(), uploaded_.size() * sizeof(Point), cudaMemcpyDeviceToDevice,
                          context_.stream()),
          "limiting clouds");
  }
  limit(context_, *batch_,
        {uploaded_.data(), chain(iterations - 1).faired().data(), limited_.data(),
         Leaving::holds_back(iterations - 1, common.limits)});
}

void CudaBackend::download(std::span<Point> points) {
  context_.enter();
  leaving_.copy(limited_.size() > 0 ? limited_.data() : uploaded_.data(), points);
  deliver();
}

void CudaBackend::download(const DeviceOutput& points, DeviceStream stream) {
  context_.enter();
  require_on_card(points.data, points.count, points.type, points.card, card_);
  let_wait(stream);
  callers_.give(uploaded_.data(), limited_.size() > 0 ? limited_.data() : uploaded_.data(), points);
  deliver();
}

void CudaBackend::build_batch_index(std::span<const Index> ends) {
  clouds_.clear();
  for (std::size_t cloud = 0, first = 0; cloud < ends.size(); first = ends[cloud++])
    clouds_.push_back({static_cast<Index>(first), ends[cloud], static_cast<Index>(first)});
  batch_ = batch_storage_.plan(clouds_, uploaded_.size());
  const cudaEvent_t start = clock_.start();
  first_.build_index(uploaded_.data(), *batch_, {});
  clock_.note("index", start, first_.stream());
  is_index_begun_ = true;
}

}  // namespace pointfair::cuda
