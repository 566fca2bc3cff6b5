// SPDX-License-Identifier: Apache-2.0
// The CUDA backend: the seam's calls over two chains on one card. Stage calls start their work and return; the host
// waits only where data crosses. The first pass's index is begun while its points arrive, and where the cloud is in
// spatial order, stages and download of its parts overlap (part_flow.cuh). Memory beside the chains, bytes a point: the
// uploaded points 12, and 12 from the third pass on.
#include "backend.hpp"
#include "cuda/chain.cuh"
#include "cuda/devices.cuh"
#include "cuda/memory.cuh"
#include "cuda/outliers.cuh"
#include "cuda/stage_clock.cuh"
#include "cuda/stop.cuh"
#include "cuda/transfer.cuh"

namespace pointfair {
namespace cuda {
namespace {

constexpr float kInfinity = __builtin_inff();

class CudaBackend final : public Backend {
 public:
  CudaBackend(int card, std::size_t part) : context_(card), points_of_part_(part) {}

  DeviceInfo device() const override { return {Device::cuda, context_.name(), "requested"}; }

  void upload(std::span<const Point> points) override {
    begin_upload(points, false);
    finish_upload();
  }
  bool start_upload(std::span<const Point> points) override {
    begin_upload(points, true);
    return true;
  }
  void finish_upload() override {
    context_.enter();
    is_arriving_ = false;
    upload_.finish();
  }

  void set_originals(std::span<const Index> originals) override {
    context_.enter();
    whole_.resize(originals.size());
    check(cudaMemcpyAsync(whole_.data(), originals.data(), originals.size_bytes(), cudaMemcpyHostToDevice,
                          context_.stream()),
          "uploading indices");
    first_.set_whole(whole_.data());
  }

  void begin_pass(int pass) override {
    is_fetched_ = false;
    if (pass == 0) {
      at_work_ = &first_;
      input_ = uploaded_.data();
      return;
    }
    context_.enter();
    at_work_->join();
    if (at_work_ == &further_) {
      pass_input_.swap(further_.faired());
      input_ = pass_input_.data();
    } else {
      input_ = first_.faired().data();
    }
    at_work_ = &further_;
  }

  void order_along(std::optional<CurveCube> cube) override {
    if (cube && cube != cube_) is_index_begun_ = false;
    cube_ = cube;
  }
  void build_index(std::stop_token stop) override {
    context_.enter();
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    if (at_work_ != &first_ || !std::exchange(is_index_begun_, false)) begin_index(nullptr, stop);
  }
  void find_neighbors(const NeighborSettings& settings, std::stop_token stop) override {
    const cudaEvent_t start = start_stage();
    at_work_->find_neighbors(settings, is_arriving_ && at_work_ == &first_ && is_worth_searching_twice(), stop);
    clock_.note("neighbors", start, at_work_->stream());
  }
  void estimate_normals(const NormalSettings& settings, std::stop_token stop) override {
    const cudaEvent_t start = start_stage();
    at_work_->estimate_normals(settings, stop);
    if (!at_work_->normals_wait()) clock_.note("normals", start, at_work_->stream());
  }
  void fair(const FairingSettings& settings, std::stop_token stop) override {
    const bool with_normals = at_work_->normals_wait();
    const cudaEvent_t start = start_stage();
    at_work_->fair(settings, std::exchange(expects_download_, false), stop);
    clock_.note(with_normals ? kBoth : "fairing", start, at_work_->stream());
  }

  void expect_download() override { expects_download_ = true; }

  void finish() override {
    context_.enter();
    at_work_->settle();
    deliver();
  }
  std::optional<Stage> take_stopped() override {
    context_.enter();
    const unsigned call = stop_line_.given_up();
    stop_line_.clear();
    if (call == 0) return std::nullopt;
    return call >= kFurtherCalls ? Stage::iterations : Stage(call);
  }
  std::vector<StageTime> stage_times() override {
    context_.enter();
    std::vector<StageTime> times;
    for (StageTime& stage : clock_.take()) {
      if (stage.name == kBoth) {
        times.push_back({"normals", kNormalsShare * stage.milliseconds});
        stage = {"fairing", (1 - kNormalsShare) * stage.milliseconds};
      }
      times.push_back(std::move(stage));
    }
    return times;
  }
  HostBuffer host_buffer(std::size_t count) override {
    context_.enter();
    if (count == 0) return {};
    Point* points = nullptr;
    const cudaError_t status = cudaHostAlloc(&points, count * sizeof(Point), cudaHostAllocPortable);
    if (status == cudaErrorMemoryAllocation) {
      cudaGetLastError();
      throw Error(ErrorKind::memory, "no page-locked host memory for " + std::to_string(count) + " points");
    }
    check(status, "allocating page-locked memory");
    return {points, count, [](Point* memory) noexcept { cudaFreeHost(memory); }};
  }
  std::uint64_t download(std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    const cudaEvent_t start = start_stage();
    const bool may_miss_some = at_work_ != &first_;  // those that a pass before turned into NaN
    unsigned long long held_back = 0;
    if (limits.farthest > 0) {
      at_work_->join();
      copy_held_back(limits, points, outliers, held_back);
    } else {
      std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
      if (may_miss_some) {
        copy_held_back({kInfinity, kInfinity}, points, {}, held_back);
      } else {
        copy_faired(points);
      }
    }
    at_work_->fetch_state(fetched_.get());  // counts() then need not ask the card again
    clock_.note("download", start);
    clock_.read();  // while the points are on their way
    deliver();
    is_fetched_ = true;
    return held_back;
  }
  void download_normals(std::span<Point> normals) override {
    context_.enter();
    DeviceArray<Point> restored(context_);
    restored.resize(normals.size());
    at_work_->restore_normals(restored.data());
    copy_out(restored.data(), normals);
    deliver();
  }

  void download_input(std::span<Point> points) override {
    context_.enter();
    first_.join();
    upload_.finish();
    copy_out(uploaded_.data(), points);
    wait();
  }
  void outcomes(const point::Region& loaded, std::span<unsigned char> out) override {
    context_.enter();
    DeviceArray<unsigned char> found(context_);
    found.resize(out.size());
    at_work_->find_outcomes(loaded, found.data());
    check(cudaMemcpyAsync(out.data(), found.data(), out.size(), cudaMemcpyDeviceToHost, context_.stream()),
          "downloading outcomes");
    deliver();
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
    at_work_->sample_neighborhoods({asked.data(), queries.size(), k, rows.data()});
    copy_out(rows.data(), out);
    wait();
  }
  Samples take_samples(std::span<const Index> for_spacing, std::span<const Index> for_noise,
                       std::stop_token stop) override {
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    context_.enter();
    const std::size_t spacings = for_spacing.size(), noises = for_noise.size();
    queries_.resize(spacings + noises);
    spacing_samples_.resize(spacings);
    noise_samples_.resize(noises);
    residual_samples_.resize(noises);
    std::copy(for_noise.begin(), for_noise.end(), std::copy(for_spacing.begin(), for_spacing.end(), queries_.get()));
    at_work_->take_samples(
        {queries_.get(), spacings, noises, spacing_samples_.get(), noise_samples_.get(), residual_samples_.get()});
    wait();
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    std::vector residuals(residual_samples_.get(), residual_samples_.get() + noises);
    return {{spacing_samples_.get(), spacing_samples_.get() + spacings},
            {noise_samples_.get(), noise_samples_.get() + noises},
            [residuals = std::move(residuals)] { return residuals; }};
  }

  Counts counts() const override {
    context_.enter();
    const CloudState state = is_fetched_ ? *fetched_.get() : at_work_->state();
    Counts counts;
    const Index valid = at_work_ == &first_ ? state.valid : loaded_->state().valid;
    counts.unmoved = {first_.points() - valid, state.too_few_neighbors, state.no_normal};
    counts.short_neighborhoods = state.short_neighborhoods;
    return counts;
  }
  std::uint64_t peak_host_bytes() const override { return 0; }
  void limit_memory(std::uint64_t bytes) override { context_.limit(bytes); }
  std::uint64_t peak_device_bytes() const override { return context_.peak_bytes(); }

 private:
  // The paper's normals and fairing as one kernel, and what the normals take of it.
  static constexpr const char* kBoth = "normals and fairing";
  static constexpr double kNormalsShare = 0.6;
  static constexpr unsigned kFurtherCalls = 8;  // numbers of stage calls of further passes, for stops

  cudaEvent_t start_stage() {
    context_.enter();
    is_fetched_ = false;
    return clock_.start();
  }
  // Searches of parts that are there, and of their borders again, take longer than the wait for a small cloud.
  bool is_worth_searching_twice() const {
    constexpr std::size_t kWorth = 1 << 22;
    return uploaded_.size() >= kWorth || points_of_part_ > 0;
  }
  void begin_upload(std::span<const Point> points, bool timed) {
    if (points.size() > point::kNoNeighbor - kLeafSize)
      throw Error(ErrorKind::usage, "the CUDA backend holds at most 4294967263 points at once; cut the cloud");
    context_.enter();
    context_.reset_peak();
    first_.join();
    clock_.forget();
    first_.set_whole(nullptr);
    stop_line_.clear();
    uploaded_.resize(points.size());
    at_work_ = &first_;
    input_ = uploaded_.data();
    is_index_begun_ = false;
    const bool may_lie_apart = !cube_ && points_of_part_ == 0;
    Parts parts = points_of_part_ > 0 ? Parts::of(points.size(), points_of_part_) : plan_parts(points, may_lie_apart);
    const Arrival arrival = upload_.start(points, std::move(parts), uploaded_.data());
    is_arriving_ = true;
    if (timed) clock_.note_between("upload", arrival.begun, arrival.all());
    try {
      begin_index(&arrival, {});
    } catch (const Error&) {  // `points` may not be read any more
      finish_upload();
      throw;
    }
    is_index_begun_ = true;
  }
  void begin_index(const Arrival* arrival, const std::stop_token& stop) {
    is_fetched_ = false;
    const cudaEvent_t start = arrival == nullptr ? clock_.start() : arrival->all();
    at_work_->build_index(input_, uploaded_.size(), cube_, arrival, stop);
    clock_.note("index", start, at_work_->stream());
  }
  void wait() {
    context_.finish();
    clock_.pause();
  }
  // The host gets results of stages.
  void deliver() {
    wait();
    if (stop_line_.given_up() != 0) throw Error(ErrorKind::interrupted, "interrupted");
  }
  // Starts the copies; `held_back` and what the spans hold are there after wait().
  void copy_held_back(const DisplacementLimits& limits, std::span<Point> points, std::span<std::uint8_t> outliers,
                      unsigned long long& held_back) {
    DeviceArray<Point> settled(context_);
    DeviceArray<std::uint8_t> marks(context_);
    DeviceArray<unsigned long long> total(context_);
    settled.resize(points.size());
    marks.resize(outliers.size());
    total.resize(1);
    check(cudaMemsetAsync(total.data(), 0, sizeof(unsigned long long), context_.stream()), "clearing a count");
    hold_back(context_,
              {uploaded_.data(), at_work_->faired().data(), points.size(), limits.farthest, limits.outlier_distance},
              settled.data(), outliers.empty() ? nullptr : marks.data(), total.data());
    check(cudaMemcpyAsync(&held_back, total.data(), sizeof held_back, cudaMemcpyDeviceToHost, context_.stream()),
          "reading a count");
    if (!outliers.empty())
      check(cudaMemcpyAsync(outliers.data(), marks.data(), outliers.size(), cudaMemcpyDeviceToHost, context_.stream()),
            "downloading outliers");
    copy_out(settled.data(), points);
  }

  // Parts that are done before all leave at once.
  void copy_faired(std::span<Point> to) {
    const Point* const from = at_work_->faired().data();
    std::size_t left = 0;
    for (const FairedPart& part : at_work_->faired_parts()) {
      leaving_.wait_for(part.done);
      const OnStream stream(context_, leaving_);
      copy_out(from + left, to.subspan(left, part.end - left));
      left = part.end;
    }
    at_work_->join();
    if (left < to.size()) copy_out(from + left, to.subspan(left));
    if (left > 0) leaving_.join();
  }
  void copy_out(const Point* from, std::span<Point> to) {
    check(cudaMemcpyAsync(to.data(), from, to.size_bytes(), cudaMemcpyDeviceToHost, context_.stream()),
          "downloading points");
  }

  Context context_;
  StageClock clock_{context_};
  const std::size_t points_of_part_;  // 0: as plan_parts()
  Pinned<CloudState> fetched_;
  bool is_fetched_ = false;  // and as the chain at work is
  Pinned<Index> queries_;
  Pinned<point::SpacingSample> spacing_samples_;
  Pinned<point::NoiseSample> noise_samples_;
  Pinned<point::ResidualSample> residual_samples_;
  bool is_index_begun_ = false;  // by an upload
  bool is_arriving_ = false;     // the uploaded cloud
  DeviceArray<Point> uploaded_{context_};
  DeviceArray<Index> whole_{context_};       // indices in the cloud that the uploaded points are a part of
  DeviceArray<Point> pass_input_{context_};  // faired points of the further pass before
  bool expects_download_ = false;
  SideStream leaving_{context_};
  StopLine stop_line_{context_};
  Chain first_{context_, stop_line_, 0}, further_{context_, stop_line_, kFurtherCalls};
  Chain* const loaded_ = &first_;
  Chain* at_work_ = &first_;
  std::optional<CurveCube> cube_;
  const Point* input_ = nullptr;  // of the chain at work
  Upload upload_{context_};
};

}  // namespace
}  // namespace cuda

std::unique_ptr<Backend> make_cuda_backend(int card, std::size_t part) {
  cuda::require_card(card);
  return std::make_unique<cuda::CudaBackend>(card, part);
}

}  // namespace pointfair
