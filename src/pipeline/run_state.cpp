// SPDX-License-Identifier: Apache-2.0
#include "pipeline/run_state.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "estimate/automatic.hpp"
#include "pipeline/learned_run.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/device_memory.hpp"
#include "seam/overlap.hpp"
#include "seam/sampling.hpp"

namespace pointfair {
namespace {

constexpr std::array<std::string_view, 4> kStageNames{"index", "neighbors", "normals", "fairing"};
constexpr std::uint64_t kWorthChunks = 1 << 18;  // points; whose copy takes longer than what it costs to start early

std::string_view name_of(Stage stage) { return kStageNames[std::size_t(stage)]; }

IndexOrder order_for(const Params& params) {
  const bool sums_over_all = params.method == Method::implicit;
  return sums_within_radius(params) || sums_over_all ? IndexOrder::along_curve : IndexOrder::fastest;
}

FairingSettings of_iteration(FairingSettings settings, int iteration) {
  settings.is_further = iteration > 0;
  return settings;
}

std::array<double, 3> noise_quantiles(double sigma, const NoiseLevels* levels) {
  std::array<double, 3> result{sigma, sigma, sigma};
  if (levels != nullptr)
    for (std::size_t q = 0; q < result.size(); ++q) result[q] *= levels->quantiles[q];
  return result;
}

}  // namespace

void Pipeline::State::load(std::span<const Point> points) {
  start_load([&] { cloud.load(points, last_order_, false); });
}

void Pipeline::State::load(const DevicePoints& points, DeviceStream stream) {
  start_load([&] { shell.origin = cloud.load(points, stream, last_order_); });
}

void Pipeline::State::start_load(const std::function<void()>& load) {
  wide.reset();
  wide_viewpoints.clear();
  wide_run.reset();
  frame_.reset();
  given_noise_.reset();
  sensors_.reset();
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

const CloudSample& Pipeline::State::sample() {
  if (!cloud.sample) cloud.sample = cloud.backend().sampling().sample_cloud(kSampledPoints);
  return *cloud.sample;
}

const Frame& Pipeline::State::frame() {
  if (!frame_) frame_ = frame_of(sample());
  return *frame_;
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

// Queries leave what is cached as it is, but for an index where there is none.
void Pipeline::State::measure(bool with_spacing, bool with_noise, IndexOrder order, const std::stop_token& stop) {
  const WantedEstimates wanted{with_spacing && !cloud.spacing, with_noise && !cloud.noise};
  if (!wanted.spacing && !wanted.noise) return;
  sample();
  look_at_neighbors(order, stop, [&](Sampling& sampling) {
    const Estimate found = estimate(sampling, *cloud.sample, wanted, stop);
    if (wanted.spacing) cloud.spacing = found.spacing;
    if (wanted.noise) cloud.noise = found.noise, cloud.levels = found.levels, cloud.reach_levels = found.reach_levels;
  });
}

// Needs the index of the first iteration, and builds it if there is none.
void Pipeline::State::look_at_neighbors(IndexOrder order, const std::stop_token& stop,
                                        const std::function<void(Sampling&)>& estimate) {
  execute(plan_index(cloud.cached, order), 1, false, stop, {});
  log_.settle(cloud.backend());  // waits for the index, which has its own time
  const auto start = Clock::now();
  estimate(cloud.backend().sampling());
  log_.note("estimate", milliseconds_since(start));
}

void Pipeline::State::measure_all(const std::stop_token& stop) {
  attempt([&] { measure(true, true, IndexOrder::along_curve, stop); });  // as the default run's
  const Bounds& b = cloud.sample->bounds;
  estimates = Estimates{{b.min.x, b.min.y, b.min.z},
                        {b.max.x, b.max.y, b.max.z},
                        diagonal_of(b),
                        cloud.spacing->mean,
                        noise().sigma,
                        cloud.points(),
                        b.valid,
                        noise_quantiles(noise().sigma, levels().get()),
                        float_step_of(b, shell.origin),
                        noise().without_surface};
}

// What is believed of the noise, once it was measured.
Noise Pipeline::State::noise() const {
  return given_noise_ ? of_sigma(*cloud.noise, given_noise_->sigma) : *cloud.noise;
}

const std::shared_ptr<const NoiseLevels>& Pipeline::State::levels() const {
  return given_noise_ ? given_noise_->levels : cloud.levels;
}

Params Pipeline::State::resolve(const Params& params, const std::stop_token& stop) {
  check_params(params);
  Params used;
  Params asked = of_stages(params);
  attempt([&] {
    asked = with_mesh_values(asked, order_for(asked), stop);
    used = resolve_once(asked, stop);
  });
  used.method = params.method;
  if (!is_measured(asked)) {
    throw Error(ErrorKind::usage, "nothing to measure in this cloud: no surface shows in its " +
                                      std::to_string(cloud.points()) + " points, " +
                                      std::to_string(sample().bounds.valid) +
                                      " of them finite; resolve the parameters on a cloud that shows one, or leave "
                                      "them automatic");
  }
  return used;
}

// Whether what the parameters follow from was found where it was sought. A noise of 0 was found, on points that lie
// exactly on a surface; where no sample shows any, there is no surface either.
bool Pipeline::State::is_measured(const Params& params) const {
  if (needs_spacing(params) && !(cloud.spacing->mean > 0)) return false;
  const bool seeks_noise = needs_noise(params) && params.noise.is_automatic() && !given_noise_;
  return !seeks_noise || cloud.noise->surface_spacing > 0;
}

Params Pipeline::State::resolve_once(const Params& params, const std::stop_token& stop) {
  check_params(params);
  if (params.along == Along::ray && !sensors_)
    throw Error(ErrorKind::usage,
                "--along ray needs the place of the sensor, which the cloud does not tell: give --viewpoint x,y,z");
  const bool with_spacing = needs_spacing(params), with_noise = needs_noise(params);
  measure(with_spacing, with_noise, order_for(params), stop);
  // what a run sees must not depend on what was measured before it
  const Params used = resolve_params(params, with_spacing ? *cloud.spacing : Spacing{}, with_noise ? noise() : Noise{},
                                     needs_diagonal(params) ? diagonal_of(sample().bounds) : 0.0);
  if (needs_cpu_and_memory(used) && !cloud.backend().holds_all_on_host())
    throw Error(ErrorKind::usage,
                "mesh connectivity and --method implicit run on the CPU, with the whole cloud in memory: add --device "
                "cpu");
  return used;
}

void Pipeline::State::run(const Params& params, std::span<Point> out, const std::stop_token& stop,
                          const ProgressFunction& progress) {
  if (params.method == Method::learned) return run_learned(params, out, stop, progress);
  const auto deliver = [&](int iteration, const Params&, const DisplacementLimits& limits,
                           std::span<std::uint8_t> marks) {
    return timed("download", [&] { return cloud.backend().download(iteration, out, limits, marks); });
  };
  run(params, {out.size(), true, deliver, out}, stop, progress);
}

void Pipeline::State::run(const Params& params, const DeviceOutput& out, DeviceStream stream,
                          const std::stop_token& stop, const ProgressFunction& progress) {
  if (params.method == Method::learned) return run_learned(params, out, stream, stop, progress);
  const auto deliver = [&](int iteration, const Params&, const DisplacementLimits& limits,
                           std::span<std::uint8_t> marks) {
    return timed("download", [&] { return device_memory().download(iteration, out, stream, limits, marks); });
  };
  run(params, {out.count, false, deliver}, stop, progress);
}

void Pipeline::State::run(const Params& params, const Delivery& to, const std::stop_token& stop,
                          const ProgressFunction& progress) {
  shown_.reset();
  attempt([&] { run_to_end(params, to, stop, progress); });
}

DeviceMemory& Pipeline::State::device_memory() {
  if (DeviceMemory* const memory = cloud.backend().device_memory()) return *memory;
  if (device.kind == Device::cuda)
    throw Error(ErrorKind::memory,
                "the cloud does not fit into the card's memory beside its results: copy it to host memory and load it "
                "from there, and it is computed in tiles");
  throw Error(ErrorKind::usage, "the output lies on a card, and this pipeline computes on the CPU (" + device.reason +
                                    "): make it with Device::cuda, or give an output in host memory");
}

void Pipeline::State::run_to_end(const Params& params, const Delivery& to, const std::stop_token& stop,
                                 const ProgressFunction& progress) {
  if (to.room != cloud.points())
    throw Error(ErrorKind::usage, "the output holds " + std::to_string(to.room) + " points, the loaded cloud " +
                                      std::to_string(cloud.points()));
  const auto start = Clock::now();
  const double upload = std::exchange(upload_milliseconds_, 0);
  Backend& backend = cloud.backend();
  drop_times_of_failed_run();
  unfinished_ = true;
  log_ = {};
  if (upload > 0 && !std::exchange(upload_times_itself_, false)) log_.note("upload", upload);

  check_params(params);
  const Params asked = with_mesh_values(params, order_for(params), stop);
  const Params used = resolve_once(asked, stop);
  last_order_ = order_for(asked);
  followed = needs_noise(asked) ? followed_noise(asked, used, noise(), levels(), cloud.reach_levels) : FollowedNoise{};
  Settings settings = settings_of(used, followed, known_sensor(used, stop));
  if (used.connectivity == Connectivity::mesh) follow_mesh(used, settings);
  const int last = used.iterations - 1;
  execute(plan(cloud.cached, {settings, last_order_, used.iterations}), std::size_t(4) * std::size_t(used.iterations),
          to.by_parts && last == 0 && cloud.points() >= kWorthChunks, stop, progress);

  std::vector<std::uint8_t> marks(used.outliers == Outliers::mark ? cloud.points() : 0);
  const OutlierCounts outlier_counts = to.deliver(last, used, settings.limits, marks);
  const MeshReport mesh_found = used.connectivity == Connectivity::mesh ? finish_mesh(used, to.on_host) : MeshReport{};
  Counts counts = backend.counts(last);
  // who moved once and lost its neighbours or its normal in a further iteration did not keep its place
  if (last > 0) counts.unmoved = backend.counts(0).unmoved;
  const Costs costs = log_.settle(backend);

  unfinished_ = false;
  outliers = std::move(marks);
  shown_ = last;
  report = {device,
            cloud.points(),
            used,
            counts.unmoved,
            counts.short_neighborhoods,
            log_.stages(),
            mesh_found,
            backend.solver_report(last),
            costs.tiles,
            upload + milliseconds_since(start),
            costs.peak_host_bytes,
            costs.peak_device_bytes};
  if (!moves_along_normal(used.method)) report.unmoved.no_normal = 0;
  report.unmoved.outliers = outlier_counts.total();
  report.unmoved.outliers_by_reason = outlier_counts;
}

// The last of `all` stages that a run has in all; those before were cached.
void Pipeline::State::execute(const std::vector<Step>& steps, std::size_t all, bool leaves, const std::stop_token& stop,
                              const ProgressFunction& progress) {
  std::size_t done = all - std::min(all, steps.size());
  for (const Step& step : steps) {
    if (progress) progress(double(done++) / double(all), name_of(step.stage.stage));
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    cloud.cached = step.meanwhile;
    run_stage(step, leaves, stop);
    cloud.cached = step.after;
  }
  if (progress) progress(1, name_of(Stage::fairing));
}

void Pipeline::State::run_stage(const Step& step, bool leaves, const std::stop_token& stop) {
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
    case Stage::fairing:
      backend.fair(iteration, of_iteration(settings.fairing, iteration), leaves, stop);
      break;
    case Stage::iterations:
      break;
  }
  log_.note_call(name_of(stage), milliseconds_since(start));
}

void Pipeline::State::drop_times_of_failed_run() {
  if (std::exchange(unfinished_, false)) log_.settle(cloud.backend());
}

// The iteration whose normals can be told.
int Pipeline::State::shown(std::size_t room) const {
  if (!shown_ || room != cloud.points())
    throw Error(ErrorKind::usage, "normals: run first, and give an array of as many points as were loaded");
  return *shown_;
}

void Pipeline::State::normals(std::span<Point> out, const std::stop_token& stop) {
  cloud.backend().download_normals(shown(out.size()), out, stop);
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
  device_memory().download_normals(shown(out.count), out, stream);
}

void Pipeline::State::set_noise(std::span<const float> sigmas) {
  if (!sigmas.empty() && sigmas.size() != cloud.points())
    throw Error(ErrorKind::usage, "set_noise: there are " + std::to_string(sigmas.size()) +
                                      " values, and the loaded cloud has " + std::to_string(cloud.points()) +
                                      " points; give one for each");
  std::optional<GivenNoise> given;
  if (!sigmas.empty()) {
    attempt([&] {
      std::vector<Point> points(sigmas.size());
      cloud.backend().download_input(points);
      Sampling& sampling = cloud.backend().sampling();
      given = given_noise(sigmas, points,
                          [&](std::size_t count, const auto& body) { sampling.for_each_on_host(count, body); });
    });
    if (!given) throw Error(ErrorKind::usage, "set_noise: no value is positive, so none is a standard deviation");
  }
  given_noise_ = std::move(given);
  estimates.reset();
}

void Pipeline::State::set_viewpoint(std::span<const Origin> places) {
  if (places.size() > 1 && places.size() != cloud.points())
    throw Error(ErrorKind::usage, "set_viewpoint: there are " + std::to_string(places.size()) +
                                      " positions, and the loaded cloud has " + std::to_string(cloud.points()) +
                                      " points; give one, or one for each");
  SensorPlaces its;
  its.places.reserve(places.size());
  bool any_known = false;
  for (const Origin& p : places) {
    its.places.push_back({float(p[0] - shell.origin[0]), float(p[1] - shell.origin[1]), float(p[2] - shell.origin[2])});
    any_known = any_known || is_indexed(its.places.back());
  }
  beam_samples_.reset();
  sensors_ = any_known ? std::make_shared<const SensorPlaces>(std::move(its)) : nullptr;
}

// Of what a run with these parameters reads.
KnownSensor Pipeline::State::known_sensor(const Params& used, const std::stop_token& stop) {
  if (!sensors_) return {};
  KnownSensor known{sensors_};
  if (!seeks_mixed_pixels(used)) return known;
  if (!beam_samples_) {
    const CloudSample& its = sample();
    look_at_neighbors(order_for(used), stop,
                      [&](Sampling& sampling) { beam_samples_ = beam_samples(sampling, its, *sensors_); });
  }
  known.beam_width = beam_width(*beam_samples_);
  return known;
}

}  // namespace pointfair
