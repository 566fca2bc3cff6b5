// SPDX-License-Identifier: Apache-2.0
// The CUDA backend: the seam's calls over two chains on one card. Stage calls start their work and return; the host
// waits only where data crosses. The first iteration's index is begun while its points arrive, and where the cloud is
// in spatial order, stages and download of its parts overlap (part_flow.cuh). Memory beside the chains, bytes a point:
// the uploaded points 12, and 12 from the third iteration on.
#include "cuda/chain.cuh"
#include "cuda/grove.cuh"
#include "cuda/leaving.cuh"
#include "cuda/runtime/callers_points.cuh"
#include "cuda/runtime/devices.cuh"
#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/origins.cuh"
#include "cuda/runtime/stage_clock.cuh"
#include "cuda/runtime/stop.cuh"
#include "cuda/runtime/transfer.cuh"
#include "cuda/sampling/cloud_sampler.cuh"
#include "cuda/sampling/many_sampler.cuh"
#include "seam/backend.hpp"
#include "seam/device_memory.hpp"
#include "seam/exactness.hpp"
#include "seam/many_clouds.hpp"
#include "seam/overlap.hpp"
#include "seam/sampling.hpp"

namespace pointfair {
namespace cuda {
namespace {

class CudaBackend final : public Backend,
                          public Sampling,
                          public Exactness,
                          public Overlap,
                          public DeviceMemory,
                          public ManyClouds {
 public:
  CudaBackend(int card, const CudaOptions& options)
      : card_(card), context_(card, options.memory), points_of_chunk_(options.upload_chunk) {}

  DeviceInfo device() const override { return {Device::cuda, context_.name(), "requested"}; }

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

  void upload(std::span<const Point> points, IndexOrder expected) override {
    begin_upload(points, expected, false);
    finish_upload();
  }
  void start_upload(std::span<const Point> points, IndexOrder expected) override {
    begin_upload(points, expected, true);
  }
  void finish_upload() override {
    context_.enter();
    is_arriving_ = false;
    upload_.finish();
  }

  // The first guess of the origin is nearly always right, so that the index begins while the host chooses it.
  Origin upload(const DevicePoints& points, DeviceStream stream, const ChooseOrigin& choose,
                IndexOrder expected) override {
    context_.enter();
    require_on_card(points.data, points.count, points.type, points.card, card_);
    forget_cloud(points.count);
    let_wait(stream);
    callers_.start_sample(points);
    Origin origin{};
    take(points, origin, expected);
    if (const Origin chosen = choose(callers_.sample(points)); chosen != origin) {
      origin = chosen;
      take(points, origin, expected);
    }
    for (const cudaEvent_t seen : {callers_turn_.get(), callers_.sampled()})
      check(cudaStreamWaitEvent(static_cast<cudaStream_t>(stream.handle), seen), "ordering work");
    return origin;
  }

  Room room() const override { return {kMostClouds, kLargestCloud, std::size_t(1) << 24}; }
  void upload(std::span<const Point> points, std::span<const Index> ends) override {
    context_.enter();
    forget_cloud(points.size());
    if (!points.empty())
      check(cudaMemcpyAsync(uploaded_.data(), points.data(), points.size_bytes(), cudaMemcpyHostToDevice,
                            context_.stream()),
            "uploading clouds");
    plant(ends);
  }
  void upload(const DevicePoints& points, DeviceStream stream, std::span<const Index> ends) override {
    context_.enter();
    require_on_card(points.data, points.count, points.type, points.card, card_);
    forget_cloud(points.count);
    let_wait(stream);
    callers_.take(points, {}, uploaded_.data());
    plant(ends);
  }
  std::vector<std::uint8_t> surely_have_no_origin(const DevicePoints& points, DeviceStream stream,
                                                  std::span<const Index> ends) override {
    context_.enter();
    require_on_card(points.data, points.count, points.type, points.card, card_);
    let_wait(stream);
    upload_ends(ends);
    return cuda::surely_have_no_origin(context_, points, ends_.data(), ends.size());
  }

  Taken take_samples(const Queries& for_spacing, const Queries& for_noise, std::stop_token stop) override {
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    context_.enter();
    const Taken taken =
        many_samples_.take(first_.sampled_tree(), first_.input(), clouds_.size(), for_spacing, for_noise, stop);
    clock_.pause();
    return taken;
  }
  void run(std::span<const Index> clouds, std::span<const OfCloud> settings, int iterations,
           std::stop_token stop) override {
    context_.enter();
    context_.finish();  // with the nodes of clouds before
    OfCloud common = settings[0];
    common.neighbors.levels.reset();
    common.neighbors.reach_levels.reset();
    for (const OfCloud& its : settings)
      common.neighbors.min_neighbors = std::max(common.neighbors.min_neighbors, its.neighbors.min_neighbors);
    forest_ = grove_.plan(clouds_, clouds, settings, uploaded_.size(),
                          [this](std::size_t count, const auto& body) { for_each_on_host(count, body); });
    for (int iteration = 0; iteration < iterations; ++iteration) {
      if (iteration == 0) {
        first_.build_index(uploaded_.data(), *forest_, stop);
      } else {
        build_index(iteration, std::nullopt, stop);
      }
      find_neighbors(iteration, common.neighbors, stop);
      estimate_normals(iteration, common.normals, stop);
      common.fairing.is_further = iteration > 0;
      fair(iteration, common.fairing, false, stop);
    }
    if (settled_.size() == 0) {
      settled_.resize(uploaded_.size());
      check(cudaMemcpyAsync(settled_.data(), uploaded_.data(), uploaded_.size() * sizeof(Point),
                            cudaMemcpyDeviceToDevice, context_.stream()),
            "settling clouds");
    }
    settle(context_, *forest_,
           {uploaded_.data(), chain(iterations - 1).faired().data(), settled_.data(),
            Leaving::holds_back(iterations - 1, common.limits)});
  }
  void download(std::span<Point> points) override {
    context_.enter();
    leaving_.copy(settled_.size() > 0 ? settled_.data() : uploaded_.data(), points);
    deliver();
  }
  void download(const DeviceOutput& points, DeviceStream stream) override {
    context_.enter();
    require_on_card(points.data, points.count, points.type, points.card, card_);
    let_wait(stream);
    callers_.give(uploaded_.data(), settled_.size() > 0 ? settled_.data() : uploaded_.data(), points);
    deliver();
  }

  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) override {
    context_.enter();
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    if (iteration == 0) {
      if (!std::exchange(is_index_begun_, false) || frame) begin_first_index(frame, nullptr, stop);
    } else {
      const cudaEvent_t start = start_stage();
      const Point* const input = take_input_of(iteration);
      if (forest_) {
        further_.build_index(input, *forest_, stop);
      } else {
        further_.build_index(input, uploaded_.size(), frame, nullptr, stop);
      }
      clock_.note("index", start, further_.stream());
    }
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override {
    Chain& its = chain(iteration);
    const cudaEvent_t start = start_stage();
    its.find_neighbors(settings, is_arriving_ && iteration == 0 && is_worth_searching_twice(), stop);
    clock_.note("neighbors", start, its.stream());
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) override {
    Chain& its = chain(iteration);
    const cudaEvent_t start = start_stage();
    its.estimate_normals(settings, stop);
    if (!its.normals_wait()) clock_.note("normals", start, its.stream());
  }
  void fair(int iteration, const FairingSettings& settings, bool leaves, std::stop_token stop) override {
    Chain& its = chain(iteration);
    const bool with_normals = its.normals_wait();
    const cudaEvent_t start = start_stage();
    its.fair(settings, leaves, stop);
    clock_.note(with_normals ? kBoth : "fairing", start, its.stream());
  }

  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    Chain& from = chain(iteration);
    const cudaEvent_t start = start_stage();
    leaving_.begin();
    if (Leaving::holds_back(iteration, limits)) {
      from.join();
      DeviceArray<Point> settled(context_);
      leaving_.hold_back(uploaded_, from, limits, outliers, settled);
      leaving_.copy(settled.data(), points);
    } else {
      std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
      leaving_.copy_faired(from, points);
    }
    finish_download(from, start, iteration);
    return leaving_.held_back();
  }
  OutlierCounts download(int iteration, const DeviceOutput& points, DeviceStream stream,
                         const DisplacementLimits& limits, std::span<std::uint8_t> outliers) override {
    Chain& from = chain(iteration);
    const cudaEvent_t start = start_stage();
    require_on_card(points.data, points.count, points.type, points.card, card_);
    leaving_.begin();
    from.join();
    let_wait(stream);
    if (Leaving::holds_back(iteration, limits)) {
      DeviceArray<Point> settled(context_);
      leaving_.hold_back(uploaded_, from, limits, outliers, settled);
      callers_.give(uploaded_.data(), settled.data(), points);
    } else {
      std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
      callers_.give(uploaded_.data(), from.faired().data(), points);
    }
    finish_download(from, start, iteration);
    return leaving_.held_back();
  }
  void download_normals(int iteration, const DeviceOutput& normals, DeviceStream stream) override {
    Chain& from = chain(iteration);
    context_.enter();
    require_on_card(normals.data, normals.count, normals.type, normals.card, card_);
    DeviceArray<Point> restored(context_);
    restored.resize(normals.count);
    from.restore_normals(restored.data());
    let_wait(stream);
    callers_.give_plain(restored.data(), normals);
    deliver();
  }
  void download_normals(int iteration, std::span<Point> normals, std::stop_token) override {
    Chain& from = chain(iteration);
    context_.enter();
    DeviceArray<Point> restored(context_);
    restored.resize(normals.size());
    from.restore_normals(restored.data());
    leaving_.copy(restored.data(), normals);
    deliver();
  }
  void download_input(std::span<Point> points) override {
    context_.enter();
    first_.join();
    upload_.finish();
    leaving_.copy(uploaded_.data(), points);
    wait();
  }

  Counts counts(int iteration) override {
    Chain& of = chain(iteration);
    context_.enter();
    const CloudState state = fetched_iteration_ == iteration ? *fetched_.get() : of.state();
    const Index valid = iteration == 0 ? state.valid : first_.state().valid;
    Counts counts;
    counts.unmoved = {first_.points() - valid, state.too_few_neighbors, state.no_normal};
    counts.short_neighborhoods = state.short_neighborhoods;
    return counts;
  }
  Costs take_costs() override {
    context_.enter();
    Costs costs{{}, 0, context_.peak_bytes(), 1};
    for (StageTime& stage : clock_.take()) {
      if (stage.name == kBoth) {
        costs.stages.push_back({"normals", kNormalsShare * stage.milliseconds});
        stage = {"fairing", (1 - kNormalsShare) * stage.milliseconds};
      }
      costs.stages.push_back(std::move(stage));
    }
    return costs;
  }
  std::optional<StageOf> take_stopped() override {
    context_.enter();
    const unsigned call = stop_line_.given_up();
    stop_line_.clear();
    if (call == 0) return std::nullopt;
    return StageOf{call >= kFurtherCalls ? further_iteration_ : 0, Stage(call % kFurtherCalls)};
  }

  Sampling& sampling() override { return *this; }
  Exactness* exactness() override { return this; }
  Overlap* overlap() override { return this; }
  DeviceMemory* device_memory() override { return this; }
  ManyClouds* many_clouds() override { return this; }

  CloudSample sample_cloud(std::size_t count) override {
    context_.enter();
    wait_for_upload();
    CloudSample sample = sampler_.draw(uploaded_.data(), uploaded_.size(), count);
    clock_.pause();
    return sample;
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
    first_.sample_neighborhoods({asked.data(), queries.size(), k, rows.data()});
    leaving_.copy(rows.data(), out);
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
    first_.take_samples(
        {queries_.get(), spacings, noises, spacing_samples_.get(), noise_samples_.get(), residual_samples_.get()});
    wait();
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    std::vector residuals(residual_samples_.get(), residual_samples_.get() + noises);
    return {{spacing_samples_.get(), spacing_samples_.get() + spacings},
            {noise_samples_.get(), noise_samples_.get() + noises},
            [residuals = std::move(residuals)] { return residuals; }};
  }

  void outcomes(const point::Region& loaded, std::span<unsigned char> out) override {
    context_.enter();
    DeviceArray<unsigned char> found(context_);
    found.resize(out.size());
    first_.find_outcomes(loaded, found.data());
    check(cudaMemcpyAsync(out.data(), found.data(), out.size(), cudaMemcpyDeviceToHost, context_.stream()),
          "downloading outcomes");
    deliver();
  }

 private:
  // The paper's normals and fairing as one kernel, and what the normals take of it.
  static constexpr const char* kBoth = "normals and fairing";
  static constexpr double kNormalsShare = 0.6;
  static constexpr unsigned kFurtherCalls = 8;  // numbers of stage calls of further iterations, for stops
  static constexpr int kNone = -1;

  Chain& chain(int iteration) {
    if (iteration == 0) return first_;
    if (iteration != further_iteration_)
      throw Error(ErrorKind::failed, "the results of iteration " + std::to_string(iteration) + " are not held");
    return further_;
  }
  // The faired points of the iteration before.
  const Point* take_input_of(int iteration) {
    if (iteration == 1) {
      first_.join();
    } else if (iteration != further_iteration_) {
      chain(iteration - 1).join();
      input_.swap(further_.faired());
    }
    further_iteration_ = iteration;
    return iteration == 1 ? first_.faired().data() : input_.data();
  }

  cudaEvent_t start_stage() {
    context_.enter();
    fetched_iteration_ = kNone;
    return clock_.start();
  }
  // Searches of chunks that are there, and of their borders again, take longer than the wait for a small cloud.
  bool is_worth_searching_twice() const {
    constexpr std::size_t kWorth = 1 << 22;
    return uploaded_.size() >= kWorth || points_of_chunk_ > 0;
  }
  void forget_cloud(std::size_t points) {
    context_.reset_peak();
    first_.join();
    clock_.forget();
    stop_line_.clear();
    callers_.forget();
    uploaded_.resize(points);
    further_iteration_ = 0;
    is_index_begun_ = is_arriving_ = false;
    arrived_ = nullptr;
    forest_.reset();
    clouds_.clear();
    settled_.resize(0);
  }
  // What the context's stream is given from now on waits for what the caller's was given before.
  void let_wait(DeviceStream stream) {
    callers_turn_.record(static_cast<cudaStream_t>(stream.handle));
    context_.wait_for(callers_turn_.get());
  }
  // Starts to; `callers_turn_` is then after the last look at the points.
  void take(const DevicePoints& points, const Origin& origin, IndexOrder expected) {
    is_index_begun_ = false;
    callers_.take(points, origin, uploaded_.data());
    callers_turn_.record(context_.stream());
    if (expected != IndexOrder::fastest) return;
    begin_first_index(std::nullopt, nullptr, {});
    is_index_begun_ = true;
  }
  void upload_ends(std::span<const Index> ends) {
    ends_.resize(ends.size());
    if (ends.empty()) return;
    check(cudaMemcpyAsync(ends_.data(), ends.data(), ends.size_bytes(), cudaMemcpyHostToDevice, context_.stream()),
          "uploading clouds");
  }
  // The first index of many clouds.
  void plant(std::span<const Index> ends) {
    clouds_.clear();
    for (std::size_t cloud = 0, first = 0; cloud < ends.size(); first = ends[cloud++])
      clouds_.push_back({static_cast<Index>(first), ends[cloud], static_cast<Index>(first)});
    forest_ = grove_.plan(clouds_, uploaded_.size());
    const cudaEvent_t start = clock_.start();
    first_.build_index(uploaded_.data(), *forest_, {});
    clock_.note("index", start, first_.stream());
    is_index_begun_ = true;
  }
  void begin_upload(std::span<const Point> points, IndexOrder expected, bool timed) {
    context_.enter();
    forget_cloud(points.size());
    const bool may_lie_apart = expected == IndexOrder::fastest && points_of_chunk_ == 0;
    Parts parts = points_of_chunk_ > 0 ? Parts::of(points.size(), points_of_chunk_) : plan_parts(points, may_lie_apart);
    const Arrival arrival = upload_.start(points, std::move(parts), uploaded_.data());
    arrived_ = arrival.all();
    is_arriving_ = true;
    if (timed) clock_.note_between("upload", arrival.begun, arrival.all());
    if (expected != IndexOrder::fastest) return;
    try {
      begin_first_index(std::nullopt, &arrival, {});
    } catch (const Error&) {  // `points` may not be read any more
      finish_upload();
      throw;
    }
    is_index_begun_ = true;
  }
  void wait_for_upload() const {
    if (arrived_ != nullptr) context_.wait_for(arrived_);
  }
  void begin_first_index(const std::optional<Frame>& frame, const Arrival* arrival, const std::stop_token& stop) {
    fetched_iteration_ = kNone;
    if (arrival == nullptr) wait_for_upload();
    const cudaEvent_t start = arrival == nullptr ? clock_.start() : arrival->all();
    first_.build_index(uploaded_.data(), uploaded_.size(), frame, arrival, stop);
    clock_.note("index", start, first_.stream());
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
  void finish_download(Chain& from, cudaEvent_t start, int iteration) {
    from.fetch_state(fetched_.get());  // counts() then need not ask the card again
    clock_.note("download", start);
    clock_.read();  // while the points are on their way
    deliver();
    fetched_iteration_ = iteration;
  }

  const int card_;
  Context context_;
  StageClock clock_{context_};
  const std::size_t points_of_chunk_;  // 0: as plan_parts()
  Pinned<CloudState> fetched_;
  int fetched_iteration_ = kNone;  // whose state that is
  CloudSampler sampler_{context_};
  Pinned<Index> queries_;
  Pinned<point::SpacingSample> spacing_samples_;
  Pinned<point::NoiseSample> noise_samples_;
  Pinned<point::ResidualSample> residual_samples_;
  bool is_index_begun_ = false;    // by an upload
  bool is_arriving_ = false;       // the uploaded cloud
  cudaEvent_t arrived_ = nullptr;  // after which all of it is there
  DeviceArray<Point> uploaded_{context_};
  DeviceArray<Index> ends_{context_};
  std::vector<CloudSpan> clouds_;  // of many
  std::optional<Forest> forest_;   // of all of them, or of some
  Grove grove_{context_};
  ManySampler many_samples_{context_};
  DeviceArray<Point> settled_{context_};  // of many clouds
  DeviceArray<Point> input_{context_};    // of iterations from the third on
  Leaving leaving_{context_};
  CallersPoints callers_{context_};
  Event callers_turn_;  // between the caller's stream and the context's
  StopLine stop_line_{context_};
  Chain first_{context_, stop_line_, 0}, further_{context_, stop_line_, kFurtherCalls};
  int further_iteration_ = 0;  // whose results further_ holds; 0: none
  Upload upload_{context_};
};

}  // namespace
}  // namespace cuda

std::unique_ptr<Backend> make_cuda_backend(int card, const CudaOptions& options) {
  cuda::require_card(card);
  return std::make_unique<cuda::CudaBackend>(card, options);
}

}  // namespace pointfair
