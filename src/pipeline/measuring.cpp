// SPDX-License-Identifier: Apache-2.0
// What a pipeline knows of its loaded cloud, measured or given, and the parameters that follow from it.
#include <string>
#include <utility>

#include "estimate/automatic.hpp"
#include "pipeline/learned_run.hpp"
#include "pipeline/run_state.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/sampling.hpp"

namespace pointfair {

const CloudSample& Pipeline::State::sample() {
  if (!cloud.sample) cloud.sample = cloud.backend().sampling().sample_cloud(kSampledPoints);
  return *cloud.sample;
}

const Frame& Pipeline::State::frame() {
  if (!frame_) frame_ = frame_of(sample());
  return *frame_;
}

// Queries leave what is cached as it is, but for an index where there is none.
void Pipeline::State::measure(WantedEstimates wanted, IndexOrder order, const std::stop_token& stop) {
  const bool with_noise = wanted.noise, with_spacing = wanted.spacing;
  if (spacing(with_noise)) wanted.spacing = false;
  if (cloud.noise) wanted.noise = false;
  if (!wanted.spacing && !wanted.noise) return;
  sample();
  set_aside(with_noise && has_copies() ? Aside::copies : Aside::nothing);
  wanted.seeks_copies = with_noise && !cloud.copies;
  Estimate found;
  const auto look = [&](Sampling& sampling) { found = estimate(sampling, seen_sample(), wanted, stop); };
  look_at_neighbors(order, stop, look);
  if (std::exchange(wanted.seeks_copies, false)) {
    if (found.copies.within < 0) {
      cloud.copies = CopiesFound{};
    } else {
      const auto start = Clock::now();
      cloud.find_copies({found.copies.within, frame().corner}, found.copies.points, stop);
      log_.note("estimate", milliseconds_since(start));
      cloud.copies = found.copies;
      set_aside(Aside::copies);
      wanted.spacing = with_spacing;
      look_at_neighbors(order, stop, look);
    }
  }
  if (wanted.noise && has_copies() && !share_an_error(*cloud.copies, found.noise)) {  // also after a call was stopped
    cloud.copies = CopiesFound{};
    set_aside(Aside::nothing);
    wanted.spacing = with_spacing && !cloud.spacing;
    look_at_neighbors(order, stop, look);
  }
  if (wanted.spacing) spacing(with_noise) = found.spacing;
  if (wanted.noise) {
    cloud.noise = found.noise;
    cloud.levels = found.levels;
    cloud.reach_levels = found.reach_levels;
    cloud.sensor = found.sensor;
  }
}

// A cloud is measured without its copies where noise is asked for, whatever was measured before.
std::optional<Spacing>& Pipeline::State::spacing(bool with_noise) {
  return with_noise && has_copies() ? cloud.spacing_without_copies : cloud.spacing;
}

const CloudSample& Pipeline::State::seen_sample() {
  return cloud.aside() == Aside::copies ? *cloud.sample_without_copies : sample();
}

void Pipeline::State::set_aside(Aside which) {
  if (which != cloud.aside()) beam_samples_.reset();
  cloud.set_aside(which);
}

// Needs the index of the first iteration, and builds it if there is none.
void Pipeline::State::look_at_neighbors(IndexOrder order, const std::stop_token& stop,
                                        const std::function<void(Sampling&)>& estimate) {
  execute(plan_index(cloud.cached, order), 1, stop, {});
  log_.collect(cloud.backend());  // waits for the index, which has its own time
  const auto start = Clock::now();
  estimate(cloud.backend().sampling());
  log_.note("estimate", milliseconds_since(start));
}

void Pipeline::State::measure_all(const std::stop_token& stop) {
  attempt([&] { measure({true, true}, IndexOrder::along_curve, stop); });  // as the default run's
  const Bounds& bounds = cloud.sample->bounds;
  tell({*spacing(true), noise(), levels()}, bounds, float_step_of(bounds, shell.origin));
}

void Pipeline::State::tell(const Estimate& found, const Bounds& bounds, double float_step) {
  const Noise& noise = found.noise;
  estimates = Estimates{.min = {bounds.min.x, bounds.min.y, bounds.min.z},
                        .max = {bounds.max.x, bounds.max.y, bounds.max.z},
                        .diagonal = diagonal_of(bounds),
                        .spacing = found.spacing.mean,
                        .noise = noise.sigma,
                        .points = cloud.points(),
                        .finite = bounds.valid,
                        .noise_quantiles = {noise.sigma, noise.sigma, noise.sigma},
                        .float_step = float_step,
                        .without_surface = noise.without_surface,
                        .noise_is_shared = noise.is_shared,
                        .is_of_lines = noise.is_of_lines,
                        .coordinate_step = noise.coordinate_step};
  for (std::size_t q = 0; found.levels && q < estimates->noise_quantiles.size(); ++q)
    estimates->noise_quantiles[q] *= found.levels->quantiles[q];
}

// What is believed of the noise, once it was measured.
Noise Pipeline::State::noise() const { return given_noise_ ? with_given(*cloud.noise, *given_noise_) : *cloud.noise; }

const std::shared_ptr<const NoiseLevels>& Pipeline::State::levels() const {
  return given_noise_ ? given_noise_->levels : cloud.levels;
}

Params Pipeline::State::resolve(const Params& params, const std::stop_token& stop) {
  check_params(params);
  Params used;
  Params asked = of_stages(params);
  attempt([&] {
    asked = with_mesh_values(asked, order_for(asked), stop);
    used = resolve_once(asked, stop).params;
  });
  used.method = params.method;
  const WantedEstimates needed = needed_by(asked).estimates;
  Estimate found;
  if (needed.spacing) found.spacing = *spacing(needed.noise);
  if (needed.noise) found.noise = *cloud.noise;
  refuse_unmeasured(asked, found, sample().bounds.valid);
  return used;
}

// Where what the parameters follow from was sought and not found. A noise of 0 was found, on points that lie exactly on
// a surface; where no sample shows any, there is no surface either.
void Pipeline::State::refuse_unmeasured(const Params& params, const Estimate& found, std::uint64_t finite) const {
  const WantedEstimates needed = needed_by(params).estimates;
  const bool has_spacing = !needed.spacing || found.spacing.mean > 0;
  const bool seeks_noise = needed.noise && params.noise.is_automatic() && !given_noise_;
  if (has_spacing && (!seeks_noise || found.noise.surface_spacing > 0)) return;
  throw Error(ErrorKind::usage, "nothing to measure in this cloud: no surface shows in its " +
                                    std::to_string(cloud.points()) + " points, " + std::to_string(finite) +
                                    " of them finite; resolve the parameters on a cloud that shows one, or leave "
                                    "them automatic");
}

// Moves the cloud to the CPU if a run with these parameters cannot be done where it lies.
void Pipeline::State::go_where_it_runs(const Params& params) {
  Backend& here = cloud.backend();
  const bool lacks_faces = reads_faces(params) && !here.reads_faces();
  const bool lies_in_parts = needs_whole_cloud(params) && !here.holds_whole();
  if (!lacks_faces && !lies_in_parts) return;
  const auto start = Clock::now();
  if (cloud.move_to_cpu()) return log_.note("upload", milliseconds_since(start));
  throw Error(ErrorKind::usage,
              lacks_faces ? "--method fleishman, jones and implicit run along a mesh on the CPU: add --device cpu"
                          : "mesh connectivity and --method implicit need the whole cloud in the memory of one card, "
                            "and this one lies on several or in tiles: add --device cpu");
}

// Where the loaded cloud lies.
DeviceInfo Pipeline::State::device_of_cloud() {
  if (!cloud.is_on_cpu()) return device;
  DeviceInfo its = cloud.backend().device();
  its.reason = "a card cannot do this run";
  return its;
}

Resolved Pipeline::State::resolve_once(const Params& params, const std::stop_token& stop) {
  check_params(params);
  go_where_it_runs(params);
  if (params.along == Along::ray && !sensors_)
    throw Error(ErrorKind::usage,
                "--along ray needs the place of the sensor, which the cloud does not tell: give --viewpoint x,y,z");
  const Needed needed = needed_by(params);
  measure(needed.estimates, order_for(params), stop);
  Estimate found;
  if (needed.estimates.spacing) found.spacing = *spacing(needed.estimates.noise);
  if (needed.estimates.noise)
    found = {found.spacing, noise(), levels(), cloud.reach_levels, seeks_sensor_ ? cloud.sensor : KnownSensor{}};
  if (params.connectivity != Connectivity::mesh) set_copies_aside(params, stop);
  return pointfair::resolve(params, std::move(found), needed.diagonal ? diagonal_of(sample().bounds) : 0.0);
}

// Of a run along no mesh.
void Pipeline::State::set_copies_aside(const Params& params, const std::stop_token& stop) {
  Aside which = needed_by(params).estimates.noise && has_copies() ? Aside::copies : Aside::nothing;
  if (which == Aside::nothing && params.method == Method::implicit) {
    // the edges of its equations lead to one of the points at a place, whatever their number
    cloud.find_repeats(frame().corner, stop);
    which = Aside::repeats;
  }
  set_aside(which);
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
      given = given_noise(sigmas, points, cloud.backend().sampling().on_host());
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
  seeks_sensor_ = false;
  sensors_ = any_known ? std::make_shared<const SensorPlaces>(std::move(its)) : nullptr;
}

// Of what a run with these parameters reads.
KnownSensor Pipeline::State::known_sensor(const Params& used, const std::stop_token& stop) {
  if (!sensors_) return {};
  KnownSensor known{sensors_};
  if (!seeks_mixed_pixels(used)) return known;
  if (!beam_samples_) {
    const CloudSample& its = seen_sample();
    look_at_neighbors(order_for(used), stop,
                      [&](Sampling& sampling) { beam_samples_ = beam_samples(sampling, its, *sensors_); });
  }
  known.beam_width = beam_width(*beam_samples_);
  return known;
}

}  // namespace pointfair
