// SPDX-License-Identifier: Apache-2.0
#include "array_pipeline.hpp"

#include <algorithm>
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

}  // namespace

// From here until the load is complete, the pipeline holds nothing.
void ArrayPipeline::start(std::size_t points) {
  kind_ = Kind::nothing;
  own_.clear();
  before_ = {};
  points_ = points;
}

void ArrayPipeline::load(std::span<const float> coordinates, bool for_limits) {
  const std::span<const Point> points = as_points(coordinates);
  start(points.size());
  if (choose_origin(points) == Position{}) {
    if (for_limits) before_.points.assign(points.begin(), points.end());
    pipeline_.load(points);
  } else {
    own_.resize(points.size());
    std::transform(points.begin(), points.end(), own_.begin(), in_double);
    before_ = make_cloud(own_);
    pipeline_.load(before_.points);
  }
  kind_ = Kind::floats;
}

void ArrayPipeline::load(std::span<const double> coordinates, bool) {
  const std::span<const Position> positions = as_positions(coordinates);
  start(positions.size());
  own_.assign(positions.begin(), positions.end());
  before_ = make_cloud(own_);
  pipeline_.load(before_.points);
  kind_ = Kind::doubles;
}

void ArrayPipeline::load(const Cloud& cloud) {
  start(cloud.points.size());
  before_ = cloud;
  pipeline_.load(cloud);
  kind_ = Kind::cloud;
}

void ArrayPipeline::check(Kind kind, std::size_t coordinates) const {
  if (kind_ == Kind::nothing) throw Error(ErrorKind::usage, "the pipeline holds no cloud: call load first");
  if (kind_ != kind) throw Error(ErrorKind::usage, "the output has another type than what was loaded");
  if (coordinates != 3 * points_) {
    throw Error(ErrorKind::usage, "the output holds " + std::to_string(coordinates / 3) + " points, the cloud " +
                                      std::to_string(points_));
  }
}

void ArrayPipeline::limit(const Movable& movable, std::span<Point> after) const {
  std::vector<std::uint8_t> may_move = movable_points(movable.limits, before_);
  if (!movable.mask.empty()) {
    if (movable.mask.size() != points_) {
      throw Error(ErrorKind::usage, "mask has " + std::to_string(movable.mask.size()) + " values, the cloud " +
                                        std::to_string(points_) + " points");
    }
    if (may_move.empty()) may_move.assign(points_, 1);
    for (std::size_t i = 0; i < points_; ++i) may_move[i] = may_move[i] != 0 && movable.mask[i] != 0;
  }
  apply_limits(movable.limits, may_move, before_.points, after);
}

std::vector<Point> ArrayPipeline::moved(const Params& params, const Movable& movable, const Watch& watch) {
  std::vector<Point> after(points_);
  pipeline_.run(params, after, watch.stop, watch.progress);
  if (!movable.all()) limit(movable, after);
  return after;
}

void ArrayPipeline::run(const Params& params, const Movable& movable, std::span<float> out, const Watch& watch) {
  check(Kind::floats, out.size());
  const std::span<Point> result = as_points(out);
  if (own_.empty()) {
    if (!movable.all() && before_.points.size() != points_)
      throw Error(ErrorKind::failed, "the array was loaded without what limits need");
    pipeline_.run(params, result, watch.stop, watch.progress);
    if (!movable.all()) limit(movable, result);
    return;
  }
  const std::vector<Point> after = moved(params, movable, watch);
  std::vector<Position> positions = own_;
  move_positions(before_, after, positions);
  std::transform(positions.begin(), positions.end(), result.begin(), [](const Position& p) {
    return Point{float(p[0]), float(p[1]), float(p[2])};
  });
}

void ArrayPipeline::run(const Params& params, const Movable& movable, std::span<double> out, const Watch& watch) {
  check(Kind::doubles, out.size());
  const std::vector<Point> after = moved(params, movable, watch);
  const std::span<Position> result = as_positions(out);
  std::copy(own_.begin(), own_.end(), result.begin());
  move_positions(before_, after, result);
}

Cloud ArrayPipeline::run_cloud(const Params& params, const Movable& movable, const Watch& watch) {
  check(Kind::cloud, 3 * points_);
  Cloud after = pipeline_.run(params, watch.stop, watch.progress);
  if (!movable.all()) limit(movable, after.points);
  return after;
}

}  // namespace pointfair::python
