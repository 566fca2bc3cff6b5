// SPDX-License-Identifier: Apache-2.0
// A cloud in memory that is too wide for floats around one origin: it is computed in zones, by the tasks of a run in
// tiles over a work folder in memory, so that both have the same bits.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "estimate/given_noise.hpp"
#include "pointfair/pipeline.hpp"
#include "scale/tasks.hpp"

namespace pointfair::scale {

/// What a run is asked for, and what is given with the cloud.
struct WideJob {
  Params params;  ///< lengths in file units or relative
  std::optional<Position> sensor;
  bool seeks_sensor = false;  ///< as in Plan
  std::optional<GivenNoise> noise;
};

struct WideResult {
  std::vector<Position> positions;     ///< with all their digits
  std::vector<std::uint8_t> outliers;  ///< the reason of each; empty unless they are to be marked
  Report report;                       ///< without the device and the times
};

/// What a cloud shows, and the parameters that follow from it.
struct WideMeasured {
  Measured measured;
  Params params;  ///< of a run, in a typical place
};

class WideCloud {
 public:
  /// Keeps its positions, 24 bytes a point. `backend` computes it, and nothing else meanwhile.
  WideCloud(const Cloud& cloud, const Zones& zones, std::unique_ptr<Backend> backend);

  /// Whether zones can do it. The others are computed around one origin: what follows a mesh, what depends on points at
  /// any distance, and rays from several places.
  static bool can_run(const Params& params, bool has_one_sensor);

  WideResult run(const WideJob& job, const std::stop_token& stop, const ProgressFunction& progress);
  WideMeasured measure(const WideJob& job, const std::stop_token& stop);
  const Zones& zones() const { return zones_; }

 private:
  std::unique_ptr<Tasks> tasks_of(const WideJob& job, const MemoryFolder& work);

  Zones zones_;
  double coordinate_step_;
  std::shared_ptr<Source> source_;
  std::vector<Point> sample_;  // relative to the origin
  std::unique_ptr<Backend> backend_;
};

/// The limits of a cloud that was computed in zones: as if each point were relative to the middle of its own.
void apply_limits_in_zones(const Zones& zones, const Limits& limits, std::span<const std::uint8_t> movable,
                           std::span<const Position> before, std::span<Position> after);

}  // namespace pointfair::scale
