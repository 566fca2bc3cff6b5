// SPDX-License-Identifier: Apache-2.0
// Method learned: results are refined on the card before they leave it.
#include "cuda/backend.cuh"
#include "cuda/net/refiner.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;

// Where each point was measured; NaN for those that are not indexed.
__global__ void __launch_bounds__(kBlock)
    tell_noise(const Point* measured, std::size_t count, float sigma, point::NodeField levels, float* noise) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i >= count) return;
  const Point p = measured[i];
  noise[i] = point::is_indexable(p) ? sigma * point::node_value(levels, {p.x, p.y, p.z}) : __int_as_float(0x7fffffff);
}

}  // namespace

// Into `refined`. Holds back twice: as any result, so that the net sees what stays, and the whole way at last.
void CudaBackend::refine(Chain& from, const DisplacementLimits& limits, std::span<std::uint8_t> outliers,
                         const RefinedBy& by, DeviceArray<Point>& refined, const std::stop_token& stop) {
  const std::size_t count = uploaded_.size();
  for (Chain* its : {&first_, &further_}) its->set_neighborhoods_aside();
  DeviceArray<std::uint8_t> held(context_);
  held.resize(count);
  refined.resize(count);
  {
    const ShownCopies shown(*this, from);
    leaving_.hold_back(uploaded_, from, limits, outliers, refined, held.data());
  }
  copies_.hide(refined.data());
  Refiner refiner(context_);
  {
    DeviceArray<Point> normals(context_);
    DeviceArray<float> noise(context_);
    normals.resize(count);
    noise.resize(count);
    from.restore_normals(normals.data());
    launch(context_, "telling the noise", tell_noise, blocks_for(count, kBlock), kBlock, uploaded_.data(), count,
           by.sigma, from.noise_field(by.levels), noise.data());
    refiner.take({uploaded_.data(), refined.data(), normals.data(), noise.data(), count}, by.frame);
  }
  refiner.run(by.weights, held.data(), refined.data(), stop);
  copies_.follow(refined.data(), held.data());
  const ShownCopies shown(*this, from);
  if (limits.farthest > 0) leaving_.limit(uploaded_, from, limits, refined);
}

OutlierCounts CudaBackend::download_refined(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                                            std::span<std::uint8_t> outliers, const RefinedBy& by,
                                            const std::stop_token& stop) {
  Chain& from = chain(iteration);
  const cudaEvent_t start = start_stage();
  leaving_.begin();
  DeviceArray<Point> refined(context_);
  refine(from, limits, outliers, by, refined, stop);
  clock_.note("net", start);
  const cudaEvent_t computed = clock_.start();
  leaving_.copy(refined.data(), points);
  finish_download(from, computed, iteration);
  return leaving_.held_back();
}

OutlierCounts CudaBackend::download_refined(int iteration, const DeviceOutput& points, DeviceStream stream,
                                            const DisplacementLimits& limits, std::span<std::uint8_t> outliers,
                                            const RefinedBy& by, const std::stop_token& stop) {
  Chain& from = chain(iteration);
  const cudaEvent_t start = start_stage();
  require_on_card(points.data, points.count, points.type, points.card, card_);
  leaving_.begin();
  DeviceArray<Point> refined(context_);
  refine(from, limits, outliers, by, refined, stop);
  clock_.note("net", start);
  const cudaEvent_t computed = clock_.start();
  const ShownCopies shown(*this, from);
  let_wait(stream);
  callers_.give(uploaded_.data(), refined.data(), points);
  finish_download(from, computed, iteration);
  return leaving_.held_back();
}

void CudaBackend::refine(const Classical& classical, const NetWeights& weights, const Frame& frame,
                         std::span<Point> out, const std::stop_token& stop) {
  context_.enter();
  DeviceArray<Point> measured(context_), points(context_), normals(context_);
  DeviceArray<float> noise(context_);
  DeviceArray<std::uint8_t> held(context_);
  measured.upload(classical.measured, "uploading a cloud");
  points.upload(classical.points, "uploading a cloud");
  normals.upload(classical.normals, "uploading a cloud");
  noise.upload(classical.noise, "uploading a cloud");
  held.upload(classical.held, "uploading a cloud");
  Refiner refiner(context_);
  refiner.take({measured.data(), points.data(), normals.data(), noise.data(), points.size()}, frame);
  refiner.run(weights, held.data(), points.data(), stop);
  leaving_.copy(points.data(), out);
  wait();
}

}  // namespace pointfair::cuda
