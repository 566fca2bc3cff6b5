// SPDX-License-Identifier: Apache-2.0
// The CUDA backend: the seam's calls over two chains on one card. Stage calls start their work and return; the host
// waits only where data crosses. Memory beside the chains, bytes a point: the uploaded points 12, and 12 from the third
// pass on.
#include "backend.hpp"
#include "cuda/chain.cuh"
#include "cuda/devices.cuh"
#include "cuda/memory.cuh"

namespace pointfair {
namespace cuda {
namespace {

class CudaBackend final : public Backend {
 public:
  explicit CudaBackend(int card) : context_(card) {}

  DeviceInfo device() const override { return {Device::cuda, context_.name(), "requested"}; }

  void upload(std::span<const Point> points) override {
    if (points.size() > point::kNoNeighbor - kLeafSize)
      throw Error(ErrorKind::usage, "the CUDA backend holds at most 4294967263 points at once; cut the cloud");
    context_.enter();
    context_.reset_peak();
    uploaded_.resize(points.size());
    check(cudaMemcpyAsync(uploaded_.data(), points.data(), points.size_bytes(), cudaMemcpyHostToDevice,
                          context_.stream()),
          "uploading points");
    context_.finish();
    at_work_ = &first_;
    input_ = uploaded_.data();
  }

  void begin_pass(int pass) override {
    if (pass == 0) {
      at_work_ = &first_;
      input_ = uploaded_.data();
      return;
    }
    if (at_work_ == &further_) {
      pass_input_.swap(further_.faired());
      input_ = pass_input_.data();
    } else {
      input_ = first_.faired().data();
    }
    at_work_ = &further_;
  }

  void build_index(std::stop_token stop) override {
    context_.enter();
    at_work_->build_index(input_, uploaded_.size(), stop);
  }
  void find_neighbors(const NeighborSettings& settings, std::stop_token stop) override {
    context_.enter();
    at_work_->find_neighbors(settings, stop);
  }
  void estimate_normals(const NormalSettings& settings, std::stop_token stop) override {
    context_.enter();
    at_work_->estimate_normals(settings, stop);
  }
  void fair(const FairingSettings& settings, std::stop_token stop) override {
    context_.enter();
    at_work_->fair(settings, stop);
  }

  void finish() override {
    context_.enter();
    at_work_->settle();
    context_.finish();
  }
  void download(std::span<Point> points) override {
    context_.enter();
    fetch(at_work_->faired().data(), points);
  }
  void download_normals(std::span<Point> normals) override {
    context_.enter();
    DeviceArray<Point> restored(context_);
    restored.resize(normals.size());
    at_work_->restore_normals(restored.data());
    fetch(restored.data(), normals);
  }

  Bounds bounds() const override {
    context_.enter();
    const CloudState state = at_work_->state();
    if (state.valid == 0) return {};
    const auto coordinate = [](unsigned o) { return std::bit_cast<float>(unordered_bits(o)); };
    return {{coordinate(state.min[0]), coordinate(state.min[1]), coordinate(state.min[2])},
            {coordinate(state.max[0]), coordinate(state.max[1]), coordinate(state.max[2])},
            state.valid};
  }

  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    context_.enter();
    DeviceArray<Index> asked(context_);
    DeviceArray<Point> rows(context_);
    asked.resize(queries.size());
    rows.resize(out.size());
    check(
        cudaMemcpyAsync(asked.data(), queries.data(), queries.size_bytes(), cudaMemcpyHostToDevice, context_.stream()),
        "uploading queries");
    at_work_->sample_neighborhoods(asked.data(), queries.size(), k, rows.data());
    fetch(rows.data(), out);
  }

  Counts counts() const override {
    context_.enter();
    const CloudState state = at_work_->state();
    Counts counts;
    counts.unmoved = {at_work_->points() - state.valid, state.too_few_neighbors, state.no_normal};
    counts.short_neighborhoods = state.short_neighborhoods;
    return counts;
  }
  std::uint64_t peak_host_bytes() const override { return 0; }
  std::uint64_t peak_device_bytes() const override { return context_.peak_bytes(); }

 private:
  void fetch(const Point* from, std::span<Point> to) {
    check(cudaMemcpyAsync(to.data(), from, to.size_bytes(), cudaMemcpyDeviceToHost, context_.stream()),
          "downloading points");
    context_.finish();
  }

  Context context_;
  DeviceArray<Point> uploaded_{context_};
  DeviceArray<Point> pass_input_{context_};  // faired points of the further pass before
  Chain first_{context_}, further_{context_};
  Chain* at_work_ = &first_;
  const Point* input_ = nullptr;  // of the chain at work
};

}  // namespace
}  // namespace cuda

std::unique_ptr<Backend> make_cuda_backend(int card) {
  cuda::require_card(card);
  return std::make_unique<cuda::CudaBackend>(card);
}

}  // namespace pointfair
