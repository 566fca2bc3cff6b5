// SPDX-License-Identifier: Apache-2.0
// A pipeline over arrays of floats or doubles: what Python calls, without Python.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"

namespace pointfair::python {

/// Where a run hears of a stop and tells how far it is.
struct Watch {
  std::stop_token stop;
  ProgressFunction progress;
};

/// Holds one array. Scalars are the coordinates x, y, z of each point in turn. What a run writes has the type that was
/// loaded. One thread at a time.
class ArrayPipeline {
 public:
  explicit ArrayPipeline(Device device) : pipeline_(device) {}

  /// A load that is refused leaves what was loaded before; one that fails later leaves nothing.
  /// `for_limits`: keeps a copy of float positions, which runs with limits need. Doubles are always kept. `width`: of
  /// an image of points row by row, whose camera is looked for; else 0.
  void load(std::span<const float> coordinates, bool for_limits, std::size_t width = 0);
  void load(std::span<const double> coordinates, bool for_limits, std::size_t width = 0);
  /// Positions on the pipeline's card, after what `stream` was given before.
  void load(const DevicePoints& points, DeviceStream stream);
  /// Points that `limits.ignore` holds are nobody's neighbours.
  void load(const Cloud& cloud, const Limits& limits);

  /// Where the sensor stood, in the coordinates that were loaded: one position, one for each point, or none.
  void set_viewpoint(std::span<const Position> positions);
  /// The same of a loaded Cloud, as parse_viewpoints reads it.
  void set_viewpoint(const std::string& text);

  /// Throws ErrorKind::usage unless floats, or doubles, of this number were loaded. `out` may be the array that was
  /// loaded.
  void run(const Params& params, const Limits& limits, std::span<float> out, const Watch& watch);
  void run(const Params& params, const Limits& limits, std::span<double> out, const Watch& watch);
  /// The same on the card, where limits do not reach.
  void run(const Params& params, const DeviceOutput& out, DeviceStream stream, const Watch& watch);
  /// Of a loaded Cloud.
  Cloud run_cloud(const Params& params, const Limits& limits, const Watch& watch);

  /// Afterwards nothing is loaded.
  void forget();

  enum class Kind : std::uint8_t { nothing, floats, doubles, cloud, on_card };
  Kind kind() const { return kind_; }
  /// Throws ErrorKind::usage where nothing is loaded.
  void require_cloud() const;
  std::size_t points() const { return points_; }
  /// As pointfair::stored_float_step.
  double stored_float_step(const Estimates& estimates) const;
  const Position& origin() const { return before_.origin; }
  Pipeline& pipeline() { return pipeline_; }
  Report report() const;  // of the last run, places in the coordinates that were loaded
  /// What the program says of the place of the sensor and of units.
  std::vector<std::string> notes_on_file(const Estimates& estimates) const;

 private:
  void look_for_camera(const auto& points, std::size_t width);
  void hold(Kind kind, std::size_t points, ScalarType type = ScalarType::float32);
  void check(Kind kind, std::size_t coordinates) const;
  std::vector<Point> moved(const Params& params, const Limits& limits, const Watch& watch);
  void apply(const Limits& limits, std::span<Point> after) const;

  Pipeline pipeline_;
  Kind kind_ = Kind::nothing;
  std::size_t points_ = 0;
  ScalarType type_ = ScalarType::float32;  // of an array
  Cloud before_;                           // origin; and the points where something needs them
  std::vector<Selection> ignored_;
  std::optional<std::vector<Position>> viewpoints_;  // given, or found in an image, in the coordinates that were loaded
  std::vector<std::string> grid_notes_;              // until a place is given
  std::vector<Position> own_;  // the positions in double, unless floats without an origin were loaded
};

// Zeros that stay zeros keep their signs, which the arithmetic of a run does not.
void keep_zeros(std::span<const Point> before, std::span<Point> after);

}  // namespace pointfair::python
