// SPDX-License-Identifier: Apache-2.0
#include "pipeline/run_state.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "seam/device_memory.hpp"
#include "seam/stop.hpp"

namespace pointfair {
namespace {

constexpr std::array<std::string_view, 4> kStageNames{"index", "neighbors", "normals", "fairing"};

std::string_view name_of(Stage stage) { return kStageNames[std::size_t(stage)]; }

}  // namespace

void Pipeline::State::load(std::span<const Point> points) {
  start_load([&] { cloud.load(points, last_order_, false); });
}

void Pipeline::State::load(const DevicePoints& points, DeviceStream stream) {
  start_load([&] { shell.origin = cloud.load(points, stream, last_order_); });
}

void Pipeline::State::start_load(const std::function<void()>& load) {
  shell = {};
  wide.reset();
  wide_viewpoints.clear();
  wide_run.reset();
  frame_.reset();
  given_noise_.reset();
  sensors_.reset();
  seeks_sensor_ = true;
  faces_.reset();
  mesh_.reset();
  beam_samples_.reset();
  shown_.reset();
  estimates.reset();
  upload_milliseconds_ = 0;
  upload_times_itself_ = false;
  drop_times_of_failed_run();
  const auto start = Clock::now();
  load();
  upload_milliseconds_ = milliseconds_since(start);
}

void Pipeline::State::load_and_run(std::span<const Point> points, const Params& params, std::span<Point> out,
                                   const std::stop_token& stop, const ProgressFunction& progress) {
  check_params(params);
  struct Finish {
    LoadedCloud& cloud;
    ~Finish() { cloud.finish_load(); }
  } finish{cloud};
  start_load([&] { cloud.load(points, order_for(params), true); });
  upload_times_itself_ = cloud.backend().overlap() != nullptr;
  run(params, out, stop, progress);
}

// In tiles, if need be. Work that was given up after its call had returned is not cached.
void Pipeline::State::attempt(const std::function<void()>& work) {
  try {
    cloud.within_memory(work);
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::interrupted)
      if (const auto given_up = cloud.backend().take_stopped()) cloud.cached = without(cloud.cached, *given_up);
    throw;
  }
}

void Pipeline::State::run(const Params& params, std::span<Point> out, const std::stop_token& stop,
                          const ProgressFunction& progress) {
  if (params.method == Method::learned) return run_learned(params, out, stop, progress);
  const auto deliver = [&](int iteration, const Params&, const DisplacementLimits& limits,
                           std::span<std::uint8_t> marks) {
    return timed("download", [&] { return cloud.backend().download(iteration, out, limits, marks); });
  };
  run(params, {out.size(), deliver, out}, stop, progress);
}

void Pipeline::State::run(const Params& params, const DeviceOutput& out, DeviceStream stream,
                          const std::stop_token& stop, const ProgressFunction& progress) {
  if (params.method == Method::learned) return run_learned(params, out, stream, stop, progress);
  const auto deliver = [&](int iteration, const Params&, const DisplacementLimits& limits,
                           std::span<std::uint8_t> marks) {
    return timed("download", [&] { return device_memory().download(iteration, out, stream, limits, marks); });
  };
  run(params, {out.count, deliver}, stop, progress);
}

void Pipeline::State::run(const Params& params, const Delivery& to, const std::stop_token& stop,
                          const ProgressFunction& progress) {
  shown_.reset();
  attempt([&] { run_to_end(params, to, stop, progress); });
}

DeviceMemory& Pipeline::State::device_memory() {
  if (DeviceMemory* const memory = cloud.backend().device_memory()) return *memory;
  const DeviceInfo its = device_of_cloud();
  if (its.kind == Device::cuda)
    throw Error(ErrorKind::memory,
                "the cloud does not fit into the card's memory beside its results: copy it to host memory and load it "
                "from there, and it is computed in tiles");
  throw Error(ErrorKind::usage, "the output lies on a card, and this pipeline computes on the CPU (" + its.reason +
                                    "): make it with Device::cuda, or give an output in host memory");
}

void Pipeline::State::run_to_end(const Params& params, const Delivery& to, const std::stop_token& stop,
                                 const ProgressFunction& progress) {
  if (to.room != cloud.points())
    throw Error(ErrorKind::usage, "the output holds " + std::to_string(to.room) + " points, the loaded cloud " +
                                      std::to_string(cloud.points()));
  const auto start = Clock::now();
  const double upload = std::exchange(upload_milliseconds_, 0);
  drop_times_of_failed_run();
  unfinished_ = true;
  log_ = {};
  if (upload > 0 && !std::exchange(upload_times_itself_, false)) log_.note("upload", upload);

  check_params(params);
  const Params asked = with_mesh_values(params, order_for(params), stop);
  const Resolved resolved = resolve_once(asked, stop);
  const Params& used = resolved.params;
  if (used.connectivity == Connectivity::mesh && to.on_host.size() != to.room)
    throw Error(ErrorKind::usage, "mesh connectivity gives its result in host memory: give an output there");
  last_order_ = order_for(asked);
  followed = resolved.followed;
  if (used.connectivity == Connectivity::mesh) set_seams_aside(used);
  Settings settings = settings_of(resolved, known_sensor(used, stop));
  if (used.connectivity == Connectivity::mesh) follow_mesh(used, settings);
  const int last = used.iterations - 1;
  const Wanted wanted{settings, last_order_, used.iterations};
  execute(plan(cloud.cached, wanted), std::size_t(4) * std::size_t(used.iterations), stop, progress);

  Backend& backend = cloud.backend();
  std::vector<std::uint8_t> marks(used.outliers == Outliers::mark ? cloud.points() : 0);
  const OutlierCounts outlier_counts = to.deliver(last, used, settings.limits, marks);
  const MeshReport mesh_found = used.connectivity == Connectivity::mesh ? finish_mesh(used, to.on_host) : MeshReport{};
  Counts counts = backend.counts(last);
  // who moved once and lost its neighbours or its normal in a further iteration did not keep its place
  if (last > 0) counts.unmoved = backend.counts(0).unmoved;
  if (used.connectivity == Connectivity::mesh) count_seams_on_boundary(counts.unmoved);
  const Costs costs = log_.collect(backend);

  unfinished_ = false;
  outliers = std::move(marks);
  shown_ = {last, wanted, cloud.aside()};
  report = {device_of_cloud(),
            cloud.points(),
            used,
            counts.unmoved,
            counts.short_neighborhoods,
            cloud.aside() == Aside::copies ? counts.copies : 0,
            followed.without_surface,
            log_.stages(),
            mesh_found,
            backend.solver_report(last),
            costs.tiles,
            upload + milliseconds_since(start),
            costs.peak_host_bytes,
            costs.peak_device_bytes};
  if (!sensors_) report.found_sensor = one_sensor(settings, shell.origin);
  if (!moves_along_normal(used.method)) report.unmoved.no_normal = 0;
  report.unmoved.outliers = outlier_counts.total();
  report.unmoved.outliers_by_reason = outlier_counts;
  if (used.outliers == Outliers::move) report.pulled = pulled_;
}

// The last of `all` stages that a run has in all; those before were cached.
void Pipeline::State::execute(const std::vector<Step>& steps, std::size_t all, const std::stop_token& stop,
                              const ProgressFunction& progress) {
  std::size_t done = all - std::min(all, steps.size());
  for (const Step& step : steps) {
    if (progress) progress(double(done++) / double(all), name_of(step.stage.stage));
    throw_if_stopped(stop);
    cloud.cached = step.meanwhile;
    run_stage(step, stop);
    cloud.cached = step.after;
  }
  if (progress) progress(1, name_of(Stage::fairing));
}

void Pipeline::State::run_stage(const Step& step, const std::stop_token& stop) {
  Backend& backend = cloud.backend();
  const auto [iteration, stage] = step.stage;
  const Settings& settings = cloud.cached.settings;
  const auto start = Clock::now();
  switch (stage) {
    case Stage::index:
      backend.build_index(iteration, step.order == IndexOrder::along_curve ? std::optional(frame()) : std::nullopt,
                          stop);
      break;
    case Stage::neighbors:
      backend.find_neighbors(iteration, settings.neighbors, stop);
      break;
    case Stage::normals:
      backend.estimate_normals(iteration, settings.normals, stop);
      break;
    case Stage::fairing: {
      FairingSettings fairing = settings.fairing;
      fairing.is_further = iteration > 0;
      if (fairing.pull_outliers && iteration == 0) pulled_ = count_outliers(fairing, stop);
      backend.fair(iteration, fairing, stop);
      break;
    }
    case Stage::iterations:
      break;
  }
  log_.note_call(name_of(stage), milliseconds_since(start));
}

// Of the first iteration, by the stage that leaves them in place: one that pulls them in does not tell them apart.
OutlierCounts Pipeline::State::count_outliers(FairingSettings fairing, const std::stop_token& stop) {
  fairing.pull_outliers = false;
  cloud.backend().fair(0, fairing, stop);
  std::vector<Point> results(cloud.points());
  return cloud.backend().download(0, results, DisplacementLimits().or_endless(), {});
}

void Pipeline::State::drop_times_of_failed_run() {
  if (std::exchange(unfinished_, false)) log_.collect(cloud.backend());
}

// The iteration whose normals can be told. Estimates since then may have needed other points set aside.
int Pipeline::State::shown(std::size_t room, const std::stop_token& stop) {
  if (!shown_ || room != cloud.points())
    throw Error(ErrorKind::usage, "normals: run first, and give an array of as many points as were loaded");
  if (shown_->aside != cloud.aside()) {
    set_aside(shown_->aside);
    execute(plan(cloud.cached, shown_->wanted), 1, stop, {});
  }
  return shown_->iteration;
}

void Pipeline::State::normals(std::span<Point> out, const std::stop_token& stop) {
  cloud.backend().download_normals(shown(out.size(), stop), out, stop);
  if (!sensors_) return;
  std::vector<Point> points(out.size());
  cloud.backend().download_input(points);
  const std::vector<Point>& places = sensors_->places;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Point &p = points[i], &sensor = places[places.size() > 1 ? i : 0];
    Point& n = out[i];
    const float side = n.x * (sensor.x - p.x) + n.y * (sensor.y - p.y) + n.z * (sensor.z - p.z);
    if (side < 0) n = {0 - n.x, 0 - n.y, 0 - n.z};  // no -0
  }
}

void Pipeline::State::normals(const DeviceOutput& out, DeviceStream stream) {
  device_memory().download_normals(shown(out.count, {}), out, stream);
}
}  // namespace pointfair
