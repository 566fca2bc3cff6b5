// SPDX-License-Identifier: Apache-2.0
#include "cuda/backend.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {

HostBuffer CudaBackend::host_buffer(std::size_t count) {
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

void CudaBackend::upload(std::span<const Point> points, IndexOrder expected) {
  if (expected != IndexOrder::fastest && links_.any()) {
    context_.enter();
    forget_cloud(points.size());
    return links_.upload(points, uploaded_.data());
  }
  begin_upload(points, expected, false);
  finish_upload();
}

void CudaBackend::start_upload(std::span<const Point> points, IndexOrder expected) {
  begin_upload(points, expected, true);
}

void CudaBackend::finish_upload() {
  context_.enter();
  is_arriving_ = false;
  upload_.finish();
}

void CudaBackend::set_aside(std::vector<Copy> copies) {
  context_.enter();
  first_.join();
  upload_.finish();
  wait_for_upload();
  copies_.show(uploaded_.data());
  copies_.set(std::move(copies));
  copies_.hide(uploaded_.data());
  fetched_iteration_ = kNone;
  further_iteration_ = 0;
  is_index_begun_ = false;
}

CudaBackend::ShownCopies::ShownCopies(CudaBackend& of, Chain& from) : of_(of), from_(from) {
  if (!of_.copies_.any()) return;
  from_.join();
  of_.copies_.show(of_.uploaded_.data());
  of_.copies_.follow(from_.faired().data());
}

CudaBackend::ShownCopies::~ShownCopies() {
  try {
    of_.copies_.hide(of_.uploaded_.data());
    of_.copies_.hide(from_.faired().data());
  } catch (const Error&) {  // a lost card: the next call says so
  }
}

void CudaBackend::build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) {
  context_.enter();
  throw_if_stopped(stop);
  if (iteration == 0) {
    if (!std::exchange(is_index_begun_, false) || frame) begin_first_index(frame, nullptr, stop);
  } else {
    const cudaEvent_t start = start_stage();
    const Point* const input = take_input_of(iteration);
    if (batch_) {
      further_.build_index(input, *batch_, stop);
    } else {
      further_.build_index(input, uploaded_.size(), frame, nullptr, stop);
    }
    clock_.note("index", start, further_.stream());
  }
}

void CudaBackend::find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) {
  Chain& its = chain(iteration);
  const cudaEvent_t start = start_stage();
  its.find_neighbors(settings, is_arriving_ && iteration == 0 && is_worth_searching_twice(), stop);
  clock_.note("neighbors", start, its.stream());
}

void CudaBackend::estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) {
  Chain& its = chain(iteration);
  const cudaEvent_t start = start_stage();
  its.estimate_normals(settings, stop);
  if (!its.normals_wait()) clock_.note("normals", start, its.stream());
}

void CudaBackend::fair(int iteration, const FairingSettings& settings, std::stop_token stop) {
  Chain& its = chain(iteration);
  if (settings.method != Method::bilateral && its.normals_wait()) {  // no one kernel
    const cudaEvent_t before = start_stage();
    its.run_waiting_normals(stop);
    clock_.note("normals", before, its.stream());
  }
  const bool with_normals = its.normals_wait();
  const cudaEvent_t start = start_stage();
  its.fair(settings, stop);
  clock_.note(with_normals ? kBoth : "fairing", start, its.stream());
  solved_.resize(std::size_t(iteration) + 1);
  solved_.back() = its.solver_report();
}

OutlierCounts CudaBackend::download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                                    std::span<std::uint8_t> outliers) {
  Chain& from = chain(iteration);
  const cudaEvent_t start = start_stage();
  leaving_.begin();
  const ShownCopies shown(*this, from);
  if (Leaving::holds_back(iteration, limits)) {
    from.join();
    DeviceArray<Point> limited(context_);
    leaving_.hold_back(uploaded_, from, limits, outliers, limited);
    copy_out(limited.data(), points);
  } else {
    std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
    if (links_.any() || copies_.any()) {
      from.join();
      copy_out(from.faired().data(), points);
    } else {
      leaving_.copy_faired(from, points);
    }
  }
  finish_download(from, start, iteration);
  return leaving_.held_back();
}

void CudaBackend::download_normals(int iteration, std::span<Point> normals, std::stop_token) {
  Chain& from = chain(iteration);
  context_.enter();
  DeviceArray<Point> restored(context_);
  restored.resize(normals.size());
  from.restore_normals(restored.data());
  copies_.follow(restored.data());
  leaving_.copy(restored.data(), normals);
  deliver();
}

void CudaBackend::download_input(std::span<Point> points) {
  context_.enter();
  first_.join();
  upload_.finish();
  leaving_.copy(uploaded_.data(), points);
  wait();
  for (const Copy& copy : copies_.all()) points[copy.point] = copy.place;
}

Counts CudaBackend::counts(int iteration) {
  Chain& of = chain(iteration);
  context_.enter();
  const auto state_of = [&](int which) {
    if (fetched_iteration_ == kNone || (which != 0 && which != fetched_iteration_)) return chain(which).state();
    return fetched_.get()[which == 0 ? 0 : 1];
  };
  const CloudState state = state_of(iteration);
  const Index valid = state_of(0).valid;
  Counts counts;
  counts.unmoved = {first_.points() - valid - copies_.all().size(), state.too_few_neighbors, state.no_normal};
  counts.unmoved.boundary = of.held_of_boundary();
  counts.short_neighborhoods = state.short_neighborhoods;
  add_copies(copies_.all(), uploaded_.size(), counts, [&](std::span<unsigned char> outcomes) {
    DeviceArray<unsigned char> found(context_);
    found.resize(outcomes.size());
    of.find_outcomes(kEverywhere, found.data());
    found.download(outcomes, "downloading outcomes");
    wait();
  });
  return counts;
}

Costs CudaBackend::take_costs() {
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

std::optional<StageOf> CudaBackend::take_stopped() {
  context_.enter();
  const unsigned call = stop_line_.given_up();
  stop_line_.clear();
  if (call == 0) return std::nullopt;
  return StageOf{call >= kFurtherCalls ? further_iteration_ : 0, Stage(call % kFurtherCalls)};
}

Chain& CudaBackend::chain(int iteration) {
  if (iteration == 0) return first_;
  if (iteration != further_iteration_)
    throw Error(ErrorKind::failed, "the results of iteration " + std::to_string(iteration) + " are not held");
  return further_;
}

const Point* CudaBackend::take_input_of(int iteration) {
  if (iteration == 1) {
    first_.join();
  } else if (iteration != further_iteration_) {
    chain(iteration - 1).join();
    input_.swap(further_.faired());
  }
  further_iteration_ = iteration;
  return iteration == 1 ? first_.faired().data() : input_.data();
}

cudaEvent_t CudaBackend::start_stage() {
  context_.enter();
  fetched_iteration_ = kNone;
  return clock_.start();
}

bool CudaBackend::is_worth_searching_twice() const {
  constexpr std::size_t kWorth = 1 << 22;
  return uploaded_.size() >= kWorth || points_of_chunk_ > 0;
}

void CudaBackend::forget_cloud(std::size_t points) {
  context_.reset_peak();
  first_.join();
  clock_.forget();
  stop_line_.clear();
  callers_.forget();
  copies_.forget();
  uploaded_.resize(points);
  further_iteration_ = 0;
  is_index_begun_ = is_arriving_ = false;
  arrived_ = nullptr;
  batch_.reset();
  clouds_.clear();
  limited_.resize(0);
}

void CudaBackend::begin_upload(std::span<const Point> points, IndexOrder expected, bool timed) {
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

void CudaBackend::wait_for_upload() const {
  if (arrived_ != nullptr) context_.wait_for(arrived_);
}

void CudaBackend::begin_first_index(const std::optional<Frame>& frame, const Arrival* arrival,
                                    const std::stop_token& stop) {
  fetched_iteration_ = kNone;
  if (arrival == nullptr) wait_for_upload();
  const cudaEvent_t start = arrival == nullptr ? clock_.start() : arrival->all();
  first_.build_index(uploaded_.data(), uploaded_.size(), frame, arrival, stop);
  clock_.note("index", start, first_.stream());
}

void CudaBackend::copy_out(const Point* from, std::span<Point> to) {
  if (links_.any()) {
    links_.download(from, to);
  } else {
    leaving_.copy(from, to);
  }
}

void CudaBackend::wait() {
  context_.finish();
  clock_.pause();
}

void CudaBackend::deliver() {
  wait();
  if (stop_line_.given_up() != 0) throw Error(ErrorKind::interrupted, "interrupted");
}

void CudaBackend::finish_download(Chain& from, cudaEvent_t start, int iteration) {
  first_.fetch_state(fetched_.get());  // counts() then need not ask the card again
  if (iteration > 0) from.fetch_state(fetched_.get() + 1);
  clock_.note("download", start);
  clock_.read();  // while the points are on their way
  deliver();
  fetched_iteration_ = iteration;
}

}  // namespace pointfair::cuda

namespace pointfair {

std::unique_ptr<Backend> make_cuda_backend(int card, const CudaOptions& options) {
  cuda::require_card(card);
  return std::make_unique<cuda::CudaBackend>(card, options);
}

}  // namespace pointfair
