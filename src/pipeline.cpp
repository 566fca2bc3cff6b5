// SPDX-License-Identifier: Apache-2.0
// Which stage must run again. The stages are a chain, so one number says it: the first stage whose result is not valid.
#include "pointfair/pipeline.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>
#include <optional>
#include <utility>

#include "automatic.hpp"
#include "backend.hpp"
#include "pipeline_access.hpp"
#include "settings.hpp"

namespace pointfair {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

constexpr std::array<std::string_view, 4> kStageNames{"index", "neighbors", "normals", "fairing"};

Stage following(Stage stage) { return Stage(int(stage) + 1); }

using MakeBackend = std::function<std::unique_ptr<Backend>()>;

constexpr std::uint64_t kWorthParts = 1 << 18;  // points; whose copy takes longer than what it costs to start early
constexpr std::uint64_t kFirstPieces = 4;       // of a cloud that does not fit
constexpr std::uint64_t kLeastPiece = 2000;     // points; if so few do not fit, cutting does not help

// As the attribute "outlier", or outlier_2 and so on where the file has one of that name.
void mark_outliers(Cloud& cloud, std::span<const std::uint8_t> outliers) {
  const std::vector<AttributeInfo> present = attributes(cloud);
  std::string name = "outlier";
  for (int number = 2; std::any_of(present.begin(), present.end(), [&](const auto& a) { return a.name == name; });)
    name = "outlier_" + std::to_string(number++);
  const auto bytes = std::as_bytes(outliers);
  Attribute& attribute = cloud.added.emplace_back();
  attribute.name = std::move(name);
  attribute.type = ScalarType::uint8;
  attribute.data.assign(bytes.begin(), bytes.end());
}

std::unique_ptr<Backend> make_backend(const Device& device, DeviceInfo& info) {
  if (device.kind == Device::cpu) {
    auto backend = make_cpu_backend(device.threads);
    info = backend->device();
    info.reason = "requested";
    return backend;
  }
  try {
    auto backend = make_cuda_backend(device.index);
    info = backend->device();
    info.reason = device.kind == Device::cuda ? "requested" : "a CUDA card was found";
    return backend;
  } catch (const Error& error) {
    if (device.kind == Device::cuda) throw;
    auto backend = make_cpu_backend(device.threads);
    info = backend->device();
    info.reason = std::string("no CUDA: ") + error.what();
    return backend;
  }
}

}  // namespace

struct Pipeline::State {
  std::unique_ptr<Backend> backend;
  MakeBackend make_worker;  // of those that compute the pieces of a cloud too large for the backend; may be null
  std::uint64_t wanted_pieces = 1;  // of the loaded cloud
  DeviceInfo device;
  std::uint64_t points = 0;
  Cloud shell;  // the loaded cloud without its points

  std::vector<Point> sample;  // of the loaded cloud, for the curve

  Stage next = Stage::index;  // of the first pass; `passes` once it is complete
  bool serves_balls = false;  // the first pass's index, which is in the order that sums over balls need
  Settings settings;          // that the valid stages ran with
  int further_passes = 0;     // complete beyond the first, with `settings`

  std::optional<Spacing> spacing;
  std::optional<Noise> noise;
  std::optional<Estimates> estimates;
  std::vector<std::uint8_t> outliers;  // of the last run, if they are to be marked
  double upload_milliseconds = 0;      // not yet reported
  bool upload_times_itself = false;    // that is how long it took to start; the rest is among the stage times
  std::vector<StageTime> calls;        // stage calls and how long they took, not yet reported
  Report report;

  void load(std::span<const Point> given) {
    const auto start = Clock::now();
    load_by(given, serves_balls, [&] { backend->upload(given); });  // the next run is likely to be as the last
    upload_milliseconds = milliseconds_since(start);
  }

  template <class Upload>
  void load_by(std::span<const Point> given, bool for_balls, const Upload& upload) {
    if (given.size() > kMaxPoints)
      throw Error(ErrorKind::usage, "the cloud has " + std::to_string(given.size()) + " points, and a pipeline holds " +
                                        std::to_string(kMaxPoints) + " at most; cut it into tiles");
    forget_cloud();
    points = given.size();
    sample = curve_sample(given);
    upload_times_itself = false;
    holding_nothing_if_it_fails([&] {
      if (std::exchange(wanted_pieces, 1) > 1) backend.reset();
      require_backend();
      order_for(for_balls);
      for (bool uploaded = false; !uploaded;) try {
          upload();
          uploaded = true;
        } catch (const Error& error) {
          if (!may_cut(error)) throw;
          make_cut();
        }
    });
  }

  void forget_cloud() {
    points = 0;
    sample.clear();
    next = Stage::index;
    further_passes = 0;
    upload_milliseconds = 0;
    calls.clear();  // of a run that failed
    spacing.reset();
    noise.reset();
    estimates.reset();
  }

  // A load that fails leaves no cloud, so that nothing runs on half of one.
  template <class Work>
  void holding_nothing_if_it_fails(const Work& work) {
    try {
      work();
    } catch (...) {
      forget_cloud();
      shell = {};
      try {
        if (backend) backend->upload({});
      } catch (...) {
        backend.reset();  // a lost card
      }
      throw;
    }
  }
  void require_backend() {
    if (backend) return;
    if (!make_worker) throw Error(ErrorKind::device, "the device was lost; make another Pipeline");
    backend = make_worker();
    backend->upload({});
  }

  void load_and_run(std::span<const Point> given, const Params& params, std::span<Point> out,
                    const std::stop_token& stop, const ProgressFunction& progress) {
    check_params(params);
    struct Finish {
      State& state;
      ~Finish() {
        try {
          if (state.backend) state.backend->finish_upload();
        } catch (const Error&) {  // a lost card: the run has said so
        }
      }
    } finish{*this};
    const auto start = Clock::now();
    load_by(given, sums_balls(params), [&] { upload_times_itself = backend->start_upload(given); });
    upload_milliseconds = milliseconds_since(start);
    within_memory([&] { run(params, out, stop, progress); });
  }

  bool may_cut(const Error& error) const {
    return error.kind() == ErrorKind::memory && make_worker &&
           points / std::max(kFirstPieces, 2 * wanted_pieces) >= kLeastPiece;
  }
  // An empty backend that cuts, into twice as many pieces as before.
  void make_cut() {
    wanted_pieces = std::max(kFirstPieces, 2 * wanted_pieces);
    backend.reset();  // its memory is needed
    std::vector<std::unique_ptr<Backend>> workers;
    for (int i = 0; i < 2; ++i) workers.push_back(make_worker());
    backend = make_cut_backend(std::move(workers), {wanted_pieces});
  }
  // Does `work`; where the device's memory does not suffice, once more with the cloud in pieces.
  template <class Work>
  void within_memory(const Work& work) {
    require_backend();
    for (bool done = false; !done;) try {
        work();
        done = true;
      } catch (const Error& error) {
        if (!may_cut(error)) throw;
        std::vector<Point> input(points);
        backend->download_input(input);
        holding_nothing_if_it_fails([&] {
          make_cut();
          backend->upload(input);
        });
        next = Stage::index;
        further_passes = 0;
        calls.clear();
      }
  }

  void note_time(std::string_view name, double milliseconds) {
    for (StageTime& stage : report.stages)
      if (stage.name == name) {
        stage.milliseconds += milliseconds;
        return;
      }
    report.stages.push_back({std::string(name), milliseconds});
  }

  template <class Work>
  void timed(std::string_view name, const Work& work) {
    const auto start = Clock::now();
    work();
    note_time(name, milliseconds_since(start));
  }

  void run_stage(Stage stage, const std::stop_token& stop) {
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    const auto start = Clock::now();
    switch (stage) {
      case Stage::index:
        backend->build_index(stop);
        break;
      case Stage::neighbors:
        backend->find_neighbors(settings.neighbors, stop);
        break;
      case Stage::normals:
        backend->estimate_normals(settings.normals, stop);
        break;
      case Stage::fairing:
        backend->fair(settings.fairing, stop);
        break;
      case Stage::iterations:
        break;
    }
    calls.push_back({std::string(kStageNames[std::size_t(stage)]), milliseconds_since(start)});
  }

  // What the stages took goes into the report: by the device's clock if their calls only start them.
  void report_stages() {
    const std::vector<StageTime> measured = backend->stage_times();
    for (const StageTime& stage : measured.empty() ? calls : measured) note_time(stage.name, stage.milliseconds);
    calls.clear();
  }

  void order_for(bool balls) { backend->order_along(balls ? std::optional(curve_cube(sample)) : std::nullopt); }

  // The index of the first pass, which the estimates need too. One in the order of balls serves lists as well.
  void ensure_index(bool for_balls, const std::stop_token& stop) {
    order_for(for_balls);
    if (next != Stage::index && (serves_balls || !for_balls)) return;
    next = Stage::index;
    further_passes = 0;
    backend->begin_pass(0);
    run_stage(Stage::index, stop);
    serves_balls = for_balls;
    next = Stage::neighbors;
  }
  // Where no parameters are known: the default run's.
  void ensure_index(const std::stop_token& stop) {
    if (next == Stage::index) ensure_index(true, stop);
  }

  // The first pass's index must be the current one: estimates are of the cloud as loaded.
  void measure(bool with_spacing, bool with_noise, const std::stop_token& stop) {
    const Wanted wanted{with_spacing && !spacing, with_noise && !noise};
    if (!wanted.spacing && !wanted.noise) return;
    ensure_index(stop);
    backend->begin_pass(0);
    further_passes = 0;
    report_stages();  // waits for the index, which has its own time
    timed("estimate", [&] {
      const Estimate found = estimate(*backend, points, wanted, stop);
      if (wanted.spacing) spacing = found.spacing;
      if (wanted.noise) noise = found.noise;
    });
  }

  double diagonal() const {
    const Bounds b = backend->bounds();
    return std::hypot(double(b.max.x) - b.min.x, double(b.max.y) - b.min.y, double(b.max.z) - b.min.z);
  }

  Params resolve(const Params& params, const std::stop_token& stop) {
    check_params(params);
    ensure_index(sums_balls(params), stop);
    measure(needs_spacing(params), needs_noise(params), stop);
    // what a run sees must not depend on what was measured before it
    return resolve_params(params, needs_spacing(params) ? *spacing : Spacing{}, needs_noise(params) ? *noise : Noise{},
                          needs_diagonal(params) ? loaded_diagonal(stop) : 0.0);
  }

  double loaded_diagonal(const std::stop_token& stop) { return measured_bounds(stop).diagonal; }

  const Estimates& measured_bounds(const std::stop_token& stop) {
    if (!estimates) {
      ensure_index(stop);
      backend->begin_pass(0);
      const Bounds b = backend->bounds();
      estimates =
          Estimates{{b.min.x, b.min.y, b.min.z}, {b.max.x, b.max.y, b.max.z}, diagonal(), 0, 0, points, b.valid};
    }
    return *estimates;
  }

  void adopt(const Settings& wanted) {
    const Stage changed = first_difference(settings, wanted);
    if (changed < Stage::iterations) further_passes = 0;
    next = std::min(next, changed);
    settings = wanted;
  }

  void run_first_pass(bool only, const std::stop_token& stop, const std::function<void()>& stage_done) {
    if (next < Stage::iterations) {
      backend->begin_pass(0);
      further_passes = 0;
    }
    while (next < Stage::iterations) {
      if (only && next == Stage::fairing && points >= kWorthParts) backend->expect_download();
      run_stage(next, stop);
      next = following(next);
      stage_done();
    }
  }

  void run_further_passes(int wanted, const std::stop_token& stop, const std::function<void()>& stage_done) {
    if (further_passes > wanted) further_passes = 0;
    if (further_passes == 0) backend->begin_pass(0);
    while (further_passes < wanted) {
      const int pass = further_passes + 1;
      further_passes = 0;  // until this pass is complete its chain holds no result
      backend->begin_pass(pass);
      for (Stage stage = Stage::index; stage < Stage::iterations; stage = following(stage)) {
        run_stage(stage, stop);
        stage_done();
      }
      further_passes = pass;
    }
  }

  void run(const Params& params, std::span<Point> out, const std::stop_token& stop, const ProgressFunction& progress) {
    try {
      run_to_end(params, out, stop, progress);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::interrupted) forget_stopped();
      throw;
    }
  }

  void forget_stopped() {
    const std::optional<Stage> stopped = backend->take_stopped();
    if (!stopped) return;
    next = std::min(next, *stopped);
    further_passes = 0;
  }

  void run_to_end(const Params& params, std::span<Point> out, const std::stop_token& stop,
                  const ProgressFunction& progress) {
    if (out.size() != points)
      throw Error(ErrorKind::usage, "the output holds " + std::to_string(out.size()) + " points, the loaded cloud " +
                                        std::to_string(points));
    const auto start = Clock::now();
    const double upload = std::exchange(upload_milliseconds, 0);
    report = {};
    if (!calls.empty()) {  // of a run that failed
      calls.clear();
      backend->stage_times();
    }
    if (upload > 0 && !std::exchange(upload_times_itself, false)) note_time("upload", upload);
    const Params used = resolve(params, stop);
    adopt(settings_of(used));
    int done = int(next), all = 4 * used.iterations;
    const auto stage_done = [&] {
      ++done;
      if (progress) progress(std::min(1.0, double(done) / all), kStageNames[std::size_t(done) % 4]);
    };
    if (progress) progress(double(done) / all, kStageNames[std::size_t(done) % 4]);
    run_first_pass(used.iterations == 1, stop, stage_done);
    run_further_passes(used.iterations - 1, stop, stage_done);
    outliers.assign(used.outliers == Outliers::mark ? points : 0, 0);
    const auto computed = Clock::now();
    const std::uint64_t outlier_count = backend->download(out, settings.limits, outliers);
    calls.push_back({"download", milliseconds_since(computed)});
    report_stages();
    const Counts counts = backend->counts();
    report.device = device;
    report.points = points;
    report.tiles = backend->pieces();
    report.params = used;
    report.unmoved = counts.unmoved;
    if (!moves_along_normal(used.method)) report.unmoved.no_normal = 0;
    report.unmoved.outliers = outlier_count;
    report.short_neighborhoods = counts.short_neighborhoods;
    report.peak_host_bytes = backend->peak_host_bytes();
    report.peak_device_bytes = backend->peak_device_bytes();
    report.total_milliseconds = upload + milliseconds_since(start);
  }
};

Pipeline::Pipeline(Device device) : state_(std::make_unique<State>()) {
  state_->backend = make_backend(device, state_->device);
  if (state_->device.kind == Device::cuda)
    state_->make_worker = [card = device.index] { return make_cuda_backend(card); };
  state_->load({});
}
Pipeline::Pipeline(std::unique_ptr<State> state) : state_(std::move(state)) {}
Pipeline::~Pipeline() = default;
Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;

Pipeline PipelineAccess::make(std::unique_ptr<Backend> backend, DeviceInfo device,
                              std::function<std::unique_ptr<Backend>()> make_worker) {
  auto state = std::make_unique<Pipeline::State>();
  state->backend = std::move(backend);
  state->device = std::move(device);
  state->make_worker = std::move(make_worker);
  return Pipeline(std::move(state));
}

void Pipeline::load(const Cloud& cloud) {
  state_->shell = Cloud{cloud.origin, {}, cloud.added, cloud.source};
  state_->load(cloud.points);
}

void Pipeline::load(std::span<const Point> points) {
  state_->shell = {};
  state_->load(points);
}

Cloud Pipeline::run(const Params& params, std::stop_token stop, const ProgressFunction& progress) {
  std::vector<Point> out(state_->points);
  run(params, out, std::move(stop), progress);
  Cloud result = state_->shell;
  result.points = std::move(out);
  if (!state_->outliers.empty()) mark_outliers(result, state_->outliers);
  return result;
}

void Pipeline::run(const Params& params, std::span<Point> out, std::stop_token stop, const ProgressFunction& progress) {
  state_->within_memory([&] { state_->run(params, out, stop, progress); });
}

void Pipeline::run(std::span<const Point> points, const Params& params, std::span<Point> out, std::stop_token stop,
                   const ProgressFunction& progress) {
  if (out.size() != points.size())
    throw Error(ErrorKind::usage, "the output holds " + std::to_string(out.size()) + " points, the cloud " +
                                      std::to_string(points.size()));
  state_->shell = {};
  state_->load_and_run(points, params, out, stop, progress);
}

const Estimates& Pipeline::estimates(std::stop_token stop) {
  State& state = *state_;
  state.within_memory([&] {
    state.measured_bounds(stop);
    state.measure(true, true, stop);
  });
  state.estimates->spacing = state.spacing->mean;
  state.estimates->noise = state.noise->sigma;
  return *state.estimates;
}

Params Pipeline::resolve(const Params& params, std::stop_token stop) {
  Params used;
  state_->within_memory([&] { used = state_->resolve(params, stop); });
  return used;
}

const Report& Pipeline::report() const { return state_->report; }

HostBuffer Pipeline::host_buffer(std::size_t count) const {
  try {
    state_->require_backend();
    return state_->backend->host_buffer(count);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::memory, "no host memory for " + std::to_string(count) + " points");
  }
}

DeviceInfo Pipeline::device() const { return state_->device; }

void Pipeline::normals(std::span<Point> out) const {
  if (out.size() != state_->points || state_->next != Stage::iterations)
    throw Error(ErrorKind::usage, "normals: run first, and give an array of as many points as were loaded");
  state_->backend->download_normals(out);
}

std::span<const std::uint8_t> Pipeline::outliers() const { return state_->outliers; }

std::vector<DeviceStatus> list_devices() {
  std::vector<DeviceStatus> devices{cpu_status()};
  for (DeviceStatus& cuda : list_cuda_devices()) devices.push_back(std::move(cuda));
  return devices;
}

}  // namespace pointfair
