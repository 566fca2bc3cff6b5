// SPDX-License-Identifier: Apache-2.0
#include "array_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

namespace pointfair::python {
namespace {

// The same memory seen as points. A Point is three floats and a Position three doubles, as the asserts say.
static_assert(sizeof(Point) == 3 * sizeof(float) && sizeof(Position) == 3 * sizeof(double));
std::span<const Point> as_points(std::span<const float> coordinates) {
  return {reinterpret_cast<const Point*>(coordinates.data()), coordinates.size() / 3};
}
std::span<Point> as_points(std::span<float> coordinates) {
  return {reinterpret_cast<Point*>(coordinates.data()), coordinates.size() / 3};
}
std::span<const Position> as_positions(std::span<const double> coordinates) {
  return {reinterpret_cast<const Position*>(coordinates.data()), coordinates.size() / 3};
}
std::span<Position> as_positions(std::span<double> coordinates) {
  return {reinterpret_cast<Position*>(coordinates.data()), coordinates.size() / 3};
}

Position in_double(const Point& point) { return {point.x, point.y, point.z}; }

bool has_negative_zero(std::span<const Point> points) {
  const auto is_one = [](float value) { return value == 0 && std::signbit(value); };
  return std::ranges::any_of(points, [&](const Point& p) { return is_one(p.x) || is_one(p.y) || is_one(p.z); });
}

}  // namespace

void keep_zeros(std::span<const Point> before, std::span<Point> after) {
  const auto keep = [](float was, float& is) {
    if (was == 0 && is == 0) is = was;
  };
  for (std::size_t i = 0; i < before.size(); ++i) {
    keep(before[i].x, after[i].x);
    keep(before[i].y, after[i].y);
    keep(before[i].z, after[i].z);
  }
}

void ArrayPipeline::forget() {
  kind_ = Kind::nothing;
  own_.clear();
  before_ = {};
  ignored_.clear();
  viewpoints_.reset();
  grid_notes_.clear();
  points_ = 0;
}

void ArrayPipeline::hold(Kind kind, std::size_t points, ScalarType type) {
  kind_ = kind;
  points_ = points;
  type_ = type;
}

void ArrayPipeline::look_for_camera(const auto& points, std::size_t width) {
  if (width == 0) return;
  const std::optional<Position> found = image_viewpoint(points, width);
  if (found) set_viewpoint({&*found, 1});
  grid_notes_ = notes_on_grid(found);
}

void ArrayPipeline::load(std::span<const float> coordinates, bool for_limits, std::size_t width) {
  const std::span<const Point> points = as_points(coordinates);
  std::vector<Point> memory = std::move(before_.points);  // new pages cost as much as the upload
  forget();
  if (choose_origin(points) == Position{}) {
    if (for_limits || has_negative_zero(points)) {
      memory.assign(points.begin(), points.end());
      before_.points = std::move(memory);
    }
    pipeline_.load(points);
  } else {
    own_.resize(points.size());
    std::ranges::transform(points, own_.begin(), in_double);
    before_ = make_cloud(own_);
    before_.source.reset();  // floats have no more digits
    pipeline_.load(before_.points);
  }
  hold(Kind::floats, points.size());
  look_for_camera(points, width);
}

void ArrayPipeline::load(std::span<const double> coordinates, bool, std::size_t width) {
  const std::span<const Position> positions = as_positions(coordinates);
  forget();
  own_.assign(positions.begin(), positions.end());
  before_ = make_cloud(own_);
  before_.source ? pipeline_.load(before_) : pipeline_.load(before_.points);
  hold(Kind::doubles, positions.size(), ScalarType::float64);
  look_for_camera(positions, width);
}

void ArrayPipeline::load(const DevicePoints& points, DeviceStream stream) {
  if (pipeline_.device().kind != Device::cuda)
    throw Error(ErrorKind::usage,
                "the array lies on a card, and this pipeline computes on the CPU: make it with "
                "device='cuda', or copy the array to host memory");
  forget();
  before_.origin = pipeline_.load(points, stream);
  hold(Kind::on_card, points.count, points.type);
}

void ArrayPipeline::load(const Cloud& cloud, const Limits& limits) {
  std::optional<Cloud> part;
  if (!limits.ignore.empty()) part = without_ignored(limits, cloud);  // may refuse them
  forget();
  pipeline_.load(part ? *part : cloud);
  before_ = cloud;
  ignored_ = limits.ignore;
  grid_notes_ = notes_on_grid(cloud);
  hold(Kind::cloud, cloud.points.size());
}

void ArrayPipeline::set_viewpoint(std::span<const Position> positions) {
  std::vector<Position> own(positions.begin(), positions.end());
  if (!before_.source && (kind_ == Kind::floats || kind_ == Kind::doubles)) {
    std::vector<Position> relative = own;  // as the pipeline got the points
    for (Position& position : relative)
      for (std::size_t axis = 0; axis < 3; ++axis) position[axis] -= before_.origin[axis];
    pipeline_.set_viewpoint(relative);
  } else {
    pipeline_.set_viewpoint(own);
  }
  viewpoints_ = std::move(own);
  grid_notes_.clear();
}

void ArrayPipeline::set_viewpoint(const std::string& text) {
  if (kind_ != Kind::cloud)
    throw Error(ErrorKind::usage, "names of attributes need a Cloud: give the viewpoint as an array");
  const std::vector<Position> places = parse_viewpoints(text, before_);
  set_viewpoint(places);
}

std::vector<std::string> ArrayPipeline::notes_on_file(const Estimates& estimates) const {
  std::vector<std::string> notes =
      notes_on_viewpoints(viewpoints_ ? *viewpoints_ : file_viewpoints(before_), before_.origin, estimates);
  if (!pipeline_.report().found_sensor) notes.insert(notes.end(), grid_notes_.begin(), grid_notes_.end());
  const std::vector<std::string> on_units = notes_on_units(before_);
  notes.insert(notes.end(), on_units.begin(), on_units.end());
  return notes;
}

Report ArrayPipeline::report() const {
  Report report = pipeline_.report();
  const bool is_array = kind_ == Kind::floats || kind_ == Kind::doubles;
  if (is_array && !before_.source && report.found_sensor)  // the pipeline got points around an origin
    for (std::size_t axis = 0; axis < 3; ++axis) (*report.found_sensor)[axis] += before_.origin[axis];
  return report;
}

void ArrayPipeline::require_cloud() const {
  if (kind_ == Kind::nothing) throw Error(ErrorKind::usage, "the pipeline holds no cloud: call load first");
}

double ArrayPipeline::stored_float_step(const Estimates& estimates) const {
  if (kind_ == Kind::cloud) return pointfair::stored_float_step(before_, estimates);
  if (type_ != ScalarType::float32) return 0;
  Position min = before_.origin, max = before_.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    min[axis] += estimates.min[axis];
    max[axis] += estimates.max[axis];
  }
  return pointfair::stored_float_step(min, max);
}

void ArrayPipeline::check(Kind kind, std::size_t coordinates) const {
  require_cloud();
  if (kind_ != kind) throw Error(ErrorKind::usage, "the output has another type than what was loaded");
  if (coordinates != 3 * points_)
    throw Error(ErrorKind::usage, "the output holds " + std::to_string(coordinates / 3) + " points, the cloud " +
                                      std::to_string(points_));
}

void ArrayPipeline::apply(const Limits& limits, std::span<Point> after) const {
  if (limits == Limits{}) return;
  if (before_.points.size() != points_) throw Error(ErrorKind::failed, "the array was loaded without what limits need");
  apply_limits(limits, movable_points(limits, before_), before_.points, after);
}

std::vector<Point> ArrayPipeline::moved(const Params& params, const Limits& limits, const Watch& watch) {
  std::vector<Point> after(points_);
  pipeline_.run(params, after, watch.stop, watch.progress);
  apply(limits, after);
  return after;
}

void ArrayPipeline::run(const Params& params, const Limits& limits, std::span<float> out, const Watch& watch) {
  check(Kind::floats, out.size());
  const std::span<Point> result = as_points(out);
  if (own_.empty()) {
    pipeline_.run(params, result, watch.stop, watch.progress);
    apply(limits, result);
    keep_zeros(before_.points, result);
    return;
  }
  const std::vector<Point> after = moved(params, limits, watch);
  std::vector<Position> positions = own_;
  move_positions(before_, after, positions);
  std::ranges::transform(positions, result.begin(), [](const Position& p) {
    return Point{float(p[0]), float(p[1]), float(p[2])};
  });
}

void ArrayPipeline::run(const Params& params, const Limits& limits, std::span<double> out, const Watch& watch) {
  check(Kind::doubles, out.size());
  const std::span<Position> result = as_positions(out);
  if (before_.source) {
    Cloud after = pipeline_.run(params, watch.stop, watch.progress);
    apply_limits(limits, before_, after);
    positions(after, result);
    return;
  }
  const std::vector<Point> after = moved(params, limits, watch);
  std::ranges::copy(own_, result.begin());
  move_positions(before_, after, result);
}

void ArrayPipeline::run(const Params& params, const DeviceOutput& out, DeviceStream stream, const Watch& watch) {
  check(Kind::on_card, 3 * out.count);
  pipeline_.run(params, out, stream, watch.stop, watch.progress);
}

Cloud ArrayPipeline::run_cloud(const Params& params, const Limits& limits, const Watch& watch) {
  check(Kind::cloud, 3 * points_);
  Cloud after = pipeline_.run(params, watch.stop, watch.progress);
  Limits with_ignored = limits;
  with_ignored.ignore = ignored_;
  if (with_ignored != Limits{}) apply_limits(with_ignored, before_, after);
  return after;
}

}  // namespace pointfair::python
