// SPDX-License-Identifier: Apache-2.0
// The public face of a pipeline: one kind of error, clouds with their attributes, and the choice of zones.
#include "pointfair/pipeline.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "io/source.hpp"
#include "pipeline/devices.hpp"
#include "pipeline/outlier_marks.hpp"
#include "pipeline/pipeline_access.hpp"
#include "pipeline/run_state.hpp"
#include "pointfair/file_info.hpp"
#include "pointfair/viewpoint.hpp"

namespace pointfair {
namespace {

template <class Work>
auto with_one_kind_of_error(const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::memory, "out of host memory: use a smaller k, or cut the cloud");
  }
}

// Lengths in metres, of a cloud whose file says how long its unit is.
Params in_units_of(const Cloud& cloud, const Params& params) {
  return in_file_units(params, file_info(cloud).metres_per_unit);
}

// For a run on it.
Params params_for(const Cloud& cloud, const Params& params) {
  check_not_geographic(cloud);
  return in_units_of(cloud, params);
}

}  // namespace

Pipeline::Pipeline(Device device) {
  with_one_kind_of_error([&] {
    DeviceInfo info;
    std::unique_ptr<Backend> backend = make_backend(device, info);
    MakeWorkers workers = make_workers(device, info.kind);
    state_ = std::make_unique<State>(std::move(backend), std::move(info), std::move(workers));
    state_->make_backend_of_zones = [device] {
      DeviceInfo same;
      return make_backend(device, same);
    };
    state_->load({});
  });
}
Pipeline::Pipeline(std::unique_ptr<State> state) : state_(std::move(state)) {}
Pipeline::~Pipeline() = default;
Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;

Pipeline PipelineAccess::make(std::unique_ptr<Backend> backend, DeviceInfo device, MakeWorkers workers) {
  return Pipeline(std::make_unique<Pipeline::State>(std::move(backend), std::move(device), std::move(workers)));
}

const FollowedNoise& PipelineAccess::followed_noise(const Pipeline& pipeline) { return pipeline.state_->followed; }

void Pipeline::load(const Cloud& cloud) {
  with_one_kind_of_error([&] {
    io::check_has_points_of_file(cloud);
    const std::vector<Position> viewpoints = file_viewpoints(cloud);
    state_->load(cloud.points);
    state_->shell = Cloud{cloud.origin, {}, cloud.added, cloud.source};
    if (!viewpoints.empty()) state_->set_viewpoint(viewpoints);
    state_->find_zones(cloud);
    state_->wide_viewpoints = viewpoints;
  });
}

void Pipeline::set_viewpoint(std::span<const std::array<double, 3>> positions) {
  with_one_kind_of_error([&] {
    state_->set_viewpoint(positions);
    state_->wide_viewpoints.assign(positions.begin(), positions.end());
  });
}

void Pipeline::set_faces(Polygons faces) {
  with_one_kind_of_error([&] { state_->set_faces(std::move(faces)); });
}

void Pipeline::load(std::span<const Point> points) {
  with_one_kind_of_error([&] { state_->load(points); });
}

std::array<double, 3> Pipeline::load(const DevicePoints& points, DeviceStream stream) {
  return with_one_kind_of_error([&] {
    state_->load(points, stream);
    return state_->shell.origin;
  });
}

void Pipeline::set_noise(std::span<const float> sigmas) {
  with_one_kind_of_error([&] { state_->set_noise(sigmas); });
}

void Pipeline::set_weights(std::span<const std::byte> file, const std::string& name) {
  with_one_kind_of_error(
      [&] { state_->set_weights(file.empty() ? nullptr : std::make_shared<const NetWeights>(file, name)); });
}

Cloud Pipeline::run(const Params& params, std::stop_token stop, const ProgressFunction& progress) {
  return with_one_kind_of_error([&] {
    Cloud result = state_->shell;
    const Params in_units = params_for(result, params);
    if (state_->runs_in_zones(in_units)) return state_->run_in_zones(in_units, stop, progress);
    state_->wide_run.reset();
    result.points.resize(state_->cloud.points());
    state_->run(in_units, result.points, stop, progress);
    if (!state_->outliers.empty()) result.added.push_back(outlier_marks(result, state_->outliers));
    return result;
  });
}

void Pipeline::run(const Params& params, std::span<Point> out, std::stop_token stop, const ProgressFunction& progress) {
  with_one_kind_of_error([&] {
    const Params in_units = params_for(state_->shell, params);
    if (state_->runs_in_zones(in_units) && out.size() == state_->cloud.points()) {
      const Cloud result = state_->run_in_zones(in_units, stop, progress);
      std::ranges::copy(result.points, out.begin());
      return;
    }
    state_->wide_run.reset();
    state_->run(in_units, out, stop, progress);
  });
}

void Pipeline::run(std::span<const Point> points, const Params& params, std::span<Point> out, std::stop_token stop,
                   const ProgressFunction& progress) {
  if (out.size() != points.size())
    throw Error(ErrorKind::usage, "the output holds " + std::to_string(out.size()) + " points, the cloud " +
                                      std::to_string(points.size()));
  with_one_kind_of_error([&] { state_->load_and_run(points, in_units_of({}, params), out, stop, progress); });
}

void Pipeline::run(const Params& params, const DeviceOutput& out, DeviceStream stream, std::stop_token stop,
                   const ProgressFunction& progress) {
  with_one_kind_of_error([&] {
    state_->wide_run.reset();
    state_->run(params_for(state_->shell, params), out, stream, stop, progress);
  });
}

void Pipeline::run_many(std::span<const Point> points, std::span<const std::uint64_t> offsets, const Params& params,
                        std::span<Point> out, std::stop_token stop) {
  with_one_kind_of_error([&] { state_->run_many(points, offsets, in_units_of({}, params), out, stop); });
}

void Pipeline::run_many(const DevicePoints& points, DeviceStream stream, std::span<const std::uint64_t> offsets,
                        const Params& params, const DeviceOutput& out, std::stop_token stop) {
  with_one_kind_of_error([&] { state_->run_many(points, stream, offsets, in_units_of({}, params), out, stop); });
}

bool Pipeline::runs_together(const Params& params) const {
  return with_one_kind_of_error([&] { return state_->runs_together(params); });
}

const Estimates& Pipeline::estimates(std::stop_token stop) {
  with_one_kind_of_error([&] { state_->wide ? state_->measure_in_zones(stop) : state_->measure_all(stop); });
  return *state_->estimates;
}

Params Pipeline::resolve(const Params& params, std::stop_token stop) {
  return with_one_kind_of_error([&] {
    const Params in_units = in_units_of(state_->shell, params);
    return state_->runs_in_zones(in_units) ? state_->resolve_in_zones(in_units, stop) : state_->resolve(in_units, stop);
  });
}

const Report& Pipeline::report() const { return state_->report; }

HostBuffer Pipeline::host_buffer(std::size_t count) const {
  return with_one_kind_of_error([&] { return state_->cloud.backend().host_buffer(count); });
}

DeviceInfo Pipeline::device() const { return state_->device; }

std::span<const std::uint8_t> Pipeline::outliers() const { return state_->outliers; }

void Pipeline::check_normals(const Params& params, std::stop_token stop) {
  with_one_kind_of_error([&] {
    if (state_->runs_in_zones(in_units_of(state_->shell, params))) state_->check_normals_in_zones(stop);
  });
}

void Pipeline::normals(std::span<Point> out, std::stop_token stop) {
  with_one_kind_of_error([&] {
    state_->run_for_normals(stop);
    state_->normals(out, stop);
  });
}

void Pipeline::normals(const DeviceOutput& out, DeviceStream stream) {
  with_one_kind_of_error([&] { state_->normals(out, stream); });
}

void Pipeline::noise(std::span<float> out, const Params& params, std::stop_token stop) {
  with_one_kind_of_error([&] {
    if (state_->wide) state_->measure_in_zones(stop);
    state_->noise(out, in_units_of(state_->shell, params).noise, stop);
  });
}

}  // namespace pointfair
