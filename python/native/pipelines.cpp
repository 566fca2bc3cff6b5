// SPDX-License-Identifier: Apache-2.0
// Pipelines, batches, reports, devices.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <mutex>

#include "batch.hpp"
#include "bindings.hpp"
#include "card_array.hpp"
#include "interruptible.hpp"

namespace nb = nanobind;

namespace pointfair::python {
namespace {

const char* name_of(Device::Kind kind) {
  constexpr const char* kNames[] = {"auto", "cpu", "cuda"};
  return kNames[static_cast<std::size_t>(kind)];
}

// What run gives back.
const char* name_of(ArrayPipeline::Kind kind) {
  constexpr const char* kNames[] = {"nothing", "array", "array", "cloud", "array on card"};
  return kNames[static_cast<std::size_t>(kind)];
}

using OptionalBox = std::optional<std::array<double, 6>>;

// `box` is the lower and the upper corner; `where` as parse_selections reads it.
Limits limits_of(double strength, const OptionalBox& box, const std::optional<Mask>& mask, const std::string& where) {
  Limits limits{.strength = strength};
  if (box) limits.box = Box{{(*box)[0], (*box)[1], (*box)[2]}, {(*box)[3], (*box)[4], (*box)[5]}};
  if (mask) limits.mask.assign(mask->data(), mask->data() + mask->size());
  if (!where.empty()) limits.where = parse_selections("where", where);
  return limits;
}

/// A pipeline that one thread at a time may use: a second one is refused instead of let in.
class SharedPipeline {
 public:
  SharedPipeline(const std::string& device, unsigned threads) : arrays_(parse_device(device, threads)) {}

  template <class Work>
  void use(nb::handle progress, std::size_t cost, const Work& work) {
    const auto lock = take();
    run_interruptible(cost, progress, [&](const Watch& watch) { work(arrays_, watch); });
  }
  /// Of the cloud that is loaded.
  template <class Work>
  void use_cloud(const Work& work) {
    use(nb::none(), cost_of({}, arrays_.points()), [&](ArrayPipeline& arrays, const Watch& watch) {
      arrays.require_cloud();
      work(arrays, watch);
    });
  }
  template <class Work>
  void load(std::size_t points, const Work& work) {
    const auto lock = take();
    try {
      run_interruptible(cost_of({}, points), nb::none(), [&](const Watch&) { work(arrays_); });
    } catch (const nb::python_error&) {  // a signal; the caller does not know what is loaded now
      arrays_.forget();
      throw;
    }
  }
  ArrayPipeline& arrays() { return arrays_; }

 private:
  std::unique_lock<std::mutex> take() {
    std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) throw Error(ErrorKind::usage, "another thread uses this Pipeline now; make one for each thread");
    return lock;
  }

  ArrayPipeline arrays_;
  std::mutex mutex_;
};

template <class Scalar>
void load(SharedPipeline& self, const Input<Scalar>& coordinates, bool for_limits, std::size_t width) {
  self.load(coordinates.shape(0), [&](ArrayPipeline& arrays) { arrays.load(span_of(coordinates), for_limits, width); });
}

void load_cloud(SharedPipeline& self, const Cloud& cloud, const std::string& ignore) {
  Limits limits;
  if (!ignore.empty()) limits.ignore = parse_selections("ignore", ignore);
  self.load(cloud.points.size(), [&](ArrayPipeline& arrays) { arrays.load(cloud, limits); });
}

template <class Scalar>
void run(SharedPipeline& self, const Params& params, const Output<Scalar>& out, double strength, const OptionalBox& box,
         std::optional<Mask> mask, const std::string& where, nb::object progress) {
  const Limits limits = limits_of(strength, box, mask, where);
  self.use(progress, cost_of(params, out.shape(0)),
           [&](ArrayPipeline& arrays, const Watch& watch) { arrays.run(params, limits, span_of(out), watch); });
}

Cloud run_cloud(SharedPipeline& self, const Params& params, double strength, const OptionalBox& box,
                std::optional<Mask> mask, const std::string& where, nb::object progress) {
  const Limits limits = limits_of(strength, box, mask, where);
  Cloud result;
  self.use(progress, cost_of(params, self.arrays().points()),
           [&](ArrayPipeline& arrays, const Watch& watch) { result = arrays.run_cloud(params, limits, watch); });
  return result;
}

// A stream as Python's packages give it, a number.
DeviceStream stream_of(std::uintptr_t number) { return {reinterpret_cast<void*>(number)}; }

DevicePoints points_of(const CardArray& array) {
  const DeviceOutput& rows = array.rows();
  return {rows.data, rows.count, rows.row_stride, rows.column_stride, rows.type, rows.card};
}

void load_on_card(SharedPipeline& self, const CardArray& array, std::uintptr_t stream) {
  self.load(array.rows().count, [&](ArrayPipeline& arrays) { arrays.load(points_of(array), stream_of(stream)); });
}

// Load and run in one, without the way through Python between them.
void denoise_on_card(SharedPipeline& self, const CardArray& array, std::uintptr_t stream, const Params& params,
                     const CardArray& out, nb::object progress) {
  self.use(progress, cost_of(params, array.rows().count), [&](ArrayPipeline& arrays, const Watch& watch) {
    arrays.load(points_of(array), stream_of(stream));
    arrays.run(params, out.rows(), stream_of(stream), watch);
  });
}

void run_on_card(SharedPipeline& self, const Params& params, const CardArray& out, std::uintptr_t stream,
                 nb::object progress) {
  self.use(progress, cost_of(params, out.rows().count), [&](ArrayPipeline& arrays, const Watch& watch) {
    arrays.run(params, out.rows(), stream_of(stream), watch);
  });
}

void normals_on_card(SharedPipeline& self, const CardArray& out, std::uintptr_t stream) {
  self.use_cloud(
      [&](ArrayPipeline& arrays, const Watch&) { arrays.pipeline().normals(out.rows(), stream_of(stream)); });
}

// (min, max, diagonal, spacing, noise, points, finite, noise_quantiles, float_step, without_surface), with bounds in
// file coordinates.
Row estimates(SharedPipeline& self) {
  Estimates found;
  self.use_cloud([&](ArrayPipeline& arrays, const Watch& watch) { found = arrays.pipeline().estimates(watch.stop); });
  const Position& origin = self.arrays().origin();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    found.min[axis] += origin[axis];
    found.max[axis] += origin[axis];
  }
  return nb::make_tuple(nb::make_tuple(found.min[0], found.min[1], found.min[2]),
                        nb::make_tuple(found.max[0], found.max[1], found.max[2]), found.diagonal, found.spacing,
                        found.noise, found.points, found.finite,
                        nb::make_tuple(found.noise_quantiles[0], found.noise_quantiles[1], found.noise_quantiles[2]),
                        found.float_step, found.without_surface);
}

// `moves`: mean, rms, 95 % and largest length.
std::vector<std::string> notes(SharedPipeline& self, const Params& asked, const std::array<double, 4>& moves) {
  std::vector<std::string> result;
  self.use_cloud([&](ArrayPipeline& arrays, const Watch& watch) {
    Pipeline& pipeline = arrays.pipeline();
    const Estimates& found = pipeline.estimates(watch.stop);
    result = notes_on_run(asked, found, arrays.report(), {moves[0], moves[1], moves[2], moves[3]},
                          arrays.stored_float_step(found));
    std::ranges::move(arrays.notes_on_file(found), std::back_inserter(result));
  });
  std::ranges::transform(result, result.begin(), in_python);
  return result;
}

Params resolve(SharedPipeline& self, const Params& params) {
  Params result;
  self.use_cloud(
      [&](ArrayPipeline& arrays, const Watch& watch) { result = arrays.pipeline().resolve(params, watch.stop); });
  return result;
}

void normals(SharedPipeline& self, const Output<float>& out) {
  const std::span<Point> span(reinterpret_cast<Point*>(out.data()), out.shape(0));
  self.use_cloud([&](ArrayPipeline& arrays, const Watch& watch) { arrays.pipeline().normals(span, watch.stop); });
}

void check_normals(SharedPipeline& self, const Params& params) {
  self.use_cloud(
      [&](ArrayPipeline& arrays, const Watch& watch) { arrays.pipeline().check_normals(params, watch.stop); });
}

void noise(SharedPipeline& self, const Column<float>& out, const Params& params) {
  self.use_cloud(
      [&](ArrayPipeline& arrays, const Watch& watch) { arrays.pipeline().noise(span_of(out), params, watch.stop); });
}

void set_noise(SharedPipeline& self, const Column<const float>& sigmas) {
  self.use_cloud([&](ArrayPipeline& arrays, const Watch&) { arrays.pipeline().set_noise(span_of(sigmas)); });
}

void set_viewpoint(SharedPipeline& self, const Input<double>& positions) {
  const std::span<const Position> span(reinterpret_cast<const Position*>(positions.data()), positions.shape(0));
  self.use_cloud([&](ArrayPipeline& arrays, const Watch&) { arrays.set_viewpoint(span); });
}

// Rows of `sides` corners each.
void set_faces(SharedPipeline& self,
               const nb::ndarray<const std::uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>& rows) {
  Polygons faces;
  const std::size_t sides = rows.shape(1);
  faces.corners.assign(rows.data(), rows.data() + rows.size());
  for (std::size_t f = 1; f <= rows.shape(0); ++f) faces.ends.push_back(f * sides);
  self.use_cloud([&](ArrayPipeline& arrays, const Watch&) { arrays.pipeline().set_faces(std::move(faces)); });
}

void set_weights(SharedPipeline& self, const nb::bytes& file, const std::string& name) {
  const std::span bytes(reinterpret_cast<const std::byte*>(file.c_str()), file.size());
  self.use(nb::none(), 0, [&](ArrayPipeline& arrays, const Watch&) { arrays.pipeline().set_weights(bytes, name); });
}

void set_viewpoint_text(SharedPipeline& self, const std::string& text) {
  self.use_cloud([&](ArrayPipeline& arrays, const Watch&) { arrays.set_viewpoint(text); });
}

nb::ndarray<nb::numpy, bool, nb::ndim<1>> outliers(SharedPipeline& self) {
  const std::span<const std::uint8_t> found = self.arrays().pipeline().outliers();
  auto* const copy = new std::vector<std::uint8_t>(found.size());
  std::ranges::transform(found, copy->begin(), [](std::uint8_t reason) { return reason != 0; });
  nb::capsule owner(copy, [](void* pointer) noexcept { delete static_cast<std::vector<std::uint8_t>*>(pointer); });
  return {copy->data(), {copy->size()}, owner};
}

template <class Scalar>
Rows batch(SharedPipeline& self, const std::string& device, const Input<Scalar>& coordinates,
           const nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig>& offsets, const Params& params,
           unsigned threads, const Output<Scalar>& out, bool with_reports, nb::object progress) {
  std::vector<Report> reports(with_reports && offsets.size() > 0 ? offsets.size() - 1 : 0);
  self.use(progress, kAlwaysStoppable, [&](ArrayPipeline& arrays, const Watch& watch) {
    arrays.forget();
    denoise_batch<Scalar>(arrays.pipeline(), parse_device(device, threads), span_of(coordinates), span_of(offsets),
                          params, threads, span_of(out), reports, watch);
  });
  Rows result;
  for (const Report& report : reports) result.append(as_tuple(report));
  return result;
}

void batch_on_card(SharedPipeline& self, const CardArray& array, std::uintptr_t stream,
                   const nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig>& offsets, const Params& params,
                   const CardArray& out, nb::object progress) {
  const std::vector<std::uint64_t> ends(offsets.data(), offsets.data() + offsets.size());
  self.use(progress, kAlwaysStoppable, [&](ArrayPipeline& arrays, const Watch& watch) {
    arrays.forget();
    arrays.pipeline().run_many(points_of(array), stream_of(stream), ends, params, out.rows(), watch.stop);
  });
}

// (info, usable, details) of each device.
Rows devices() {
  std::vector<DeviceStatus> found;
  {
    nb::gil_scoped_release release;
    found = list_devices();
  }
  Rows rows;
  for (const DeviceStatus& status : found)
    rows.append(nb::make_tuple(as_tuple(status.info), status.usable, status.details));
  return rows;
}

template <class Scalar>
void bind_scalar(nb::class_<SharedPipeline>& pipeline, nb::module_& module) {
  pipeline.def("load", &load<Scalar>, nb::arg("coordinates").noconvert(), nb::arg("for_limits"), nb::arg("width") = 0)
      .def("run", &run<Scalar>, nb::arg("params"), nb::arg("out").noconvert(), nb::arg("strength"),
           nb::arg("box").none(), nb::arg("mask").noconvert().none(), nb::arg("where"), nb::arg("progress").none());
  module.def("denoise_batch", &batch<Scalar>, nb::arg("pipeline"), nb::arg("device"),
             nb::arg("coordinates").noconvert(), nb::arg("offsets").noconvert(), nb::arg("params"), nb::arg("threads"),
             nb::arg("out").noconvert(), nb::arg("with_reports"), nb::arg("progress").none());
}

}  // namespace

Row as_tuple(const DeviceInfo& device) { return nb::make_tuple(name_of(device.kind), device.name, device.reason); }

namespace {

nb::tuple mesh_row(const MeshReport& mesh) {
  return nb::make_tuple(mesh.faces, mesh.vertices, mesh.degenerate_faces, mesh.boundary_edges, mesh.non_manifold_edges,
                        mesh.boundary_vertices, mesh.isolated_points, mesh.folded_before, mesh.folded_after);
}

}  // namespace

Row as_tuple(const Report& report) {
  nb::list stages;
  for (const StageTime& stage : report.stages) stages.append(nb::make_tuple(stage.name, stage.milliseconds));
  const auto reasons = [](const OutlierCounts& outliers) {
    return nb::make_tuple(outliers.isolated, outliers.off_surface, outliers.mixed_pixels);
  };
  const UnmovedCounts& unmoved = report.unmoved;
  return nb::make_tuple(as_tuple(report.device), report.points, report.params,
                        nb::make_tuple(unmoved.non_finite, unmoved.too_few_neighbors, unmoved.no_normal,
                                       unmoved.outliers, reasons(unmoved.outliers_by_reason), unmoved.boundary),
                        report.short_neighborhoods, report.copies, stages, mesh_row(report.mesh),
                        nb::make_tuple(report.solver.iterations, report.solver.residual), report.tiles,
                        report.total_milliseconds, report.peak_host_bytes, report.peak_device_bytes,
                        report.found_sensor, reasons(report.pulled));
}

void bind_pipelines(nb::module_& module) {
  nb::class_<CardArray>(module, "CardArray")
      .def(nb::init<nb::ndarray<nb::ro>>(), nb::arg("array"), nb::sig("def __init__(self, array: object) -> None"))
      .def(nb::init<std::uintptr_t, std::size_t, std::ptrdiff_t, std::ptrdiff_t, bool, int>(), nb::arg("pointer"),
           nb::arg("count"), nb::arg("row_stride"), nb::arg("column_stride"), nb::arg("is_double"), nb::arg("card"));
  nb::class_<SharedPipeline> pipeline(module, "Pipeline");
  pipeline.def(nb::init<const std::string&, unsigned>(), nb::arg("device"), nb::arg("threads"));
  bind_scalar<float>(pipeline, module);
  bind_scalar<double>(pipeline, module);
  pipeline.def("load_on_card", &load_on_card, nb::arg("array"), nb::arg("stream"))
      .def("denoise_on_card", &denoise_on_card, nb::arg("array"), nb::arg("stream"), nb::arg("params"), nb::arg("out"),
           nb::arg("progress").none())
      .def("run_on_card", &run_on_card, nb::arg("params"), nb::arg("out"), nb::arg("stream"),
           nb::arg("progress").none())
      .def("normals_on_card", &normals_on_card, nb::arg("out"), nb::arg("stream"));
  pipeline.def("load_cloud", &load_cloud, nb::arg("cloud"), nb::arg("ignore"))
      .def("run_cloud", &run_cloud, nb::arg("params"), nb::arg("strength"), nb::arg("box").none(),
           nb::arg("mask").noconvert().none(), nb::arg("where"), nb::arg("progress").none())
      .def("estimates", &estimates)
      .def("resolve", &resolve, nb::arg("params"))
      .def("notes", &notes, nb::arg("asked"), nb::arg("moves"))
      .def("normals", &normals, nb::arg("out").noconvert())
      .def("check_normals", &check_normals, nb::arg("params"))
      .def("noise", &noise, nb::arg("out").noconvert(), nb::arg("params"))
      .def("set_noise", &set_noise, nb::arg("sigmas").noconvert())
      .def("set_viewpoint", &set_viewpoint, nb::arg("positions").noconvert())
      .def("set_faces", &set_faces, nb::arg("rows").noconvert())
      .def("set_viewpoint_text", &set_viewpoint_text, nb::arg("text"))
      .def("set_weights", &set_weights, nb::arg("file"), nb::arg("name"))
      .def("outliers", &outliers)
      .def("report", [](SharedPipeline& self) { return as_tuple(self.arrays().report()); })
      .def("device", [](SharedPipeline& self) { return as_tuple(self.arrays().pipeline().device()); })
      .def_prop_ro("holds", [](SharedPipeline& self) { return name_of(self.arrays().kind()); })
      .def_prop_ro("points", [](SharedPipeline& self) { return self.arrays().points(); });
  module.def("denoise_batch_on_card", &batch_on_card, nb::arg("pipeline"), nb::arg("array"), nb::arg("stream"),
             nb::arg("offsets").noconvert(), nb::arg("params"), nb::arg("out"), nb::arg("progress").none());
  module.def("devices", &devices);
}

}  // namespace pointfair::python
