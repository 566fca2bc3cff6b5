// SPDX-License-Identifier: Apache-2.0
// What a pipeline does with a cloud that is too wide for floats around one origin.
#include <cmath>
#include <utility>

#include "io/placed_source.hpp"
#include "pipeline/outlier_marks.hpp"
#include "pipeline/run_state.hpp"
#include "pointfair/positions.hpp"
#include "pointfair/run_notes.hpp"
#include "scale/wide_cloud.hpp"

namespace pointfair {
namespace {

std::optional<Position> sensor_of(const std::vector<Position>& viewpoints) {
  if (viewpoints.size() != 1 || !std::isfinite(viewpoints[0][0] + viewpoints[0][1] + viewpoints[0][2]))
    return std::nullopt;
  return viewpoints[0];
}

}  // namespace

bool needs_zones(const Cloud& cloud) { return scale::zones_of(cloud).are_several(); }

void Pipeline::State::find_zones(const Cloud& loaded) {
  const scale::Zones zones = scale::zones_of(loaded);
  if (zones.are_several() && make_backend_of_zones)
    wide = std::make_shared<scale::WideCloud>(loaded, zones, make_backend_of_zones());
}

bool Pipeline::State::runs_in_zones(const Params& params) const {
  return wide != nullptr && scale::WideCloud::can_run(params, sensor_of(wide_viewpoints).has_value());
}

Cloud Pipeline::State::run_in_zones(const Params& params, const std::stop_token& stop,
                                    const ProgressFunction& progress) {
  check_params(params);
  const auto start = Clock::now();
  wide_run.reset();
  shown_.reset();
  scale::WideResult found =
      wide->run({params, sensor_of(wide_viewpoints), seeks_sensor_, given_noise_}, stop, progress);
  Cloud result = io::placed(shell, std::move(found.positions));
  outliers = std::move(found.outliers);
  if (!outliers.empty()) result.added.push_back(outlier_marks(result, outliers));
  report = std::move(found.report);
  report.device = device;
  report.total_milliseconds = milliseconds_since(start);
  report.stages = {{"zones", report.total_milliseconds}};
  wide_run = params;
  return result;
}

void Pipeline::State::measure_in_zones(const std::stop_token& stop) {
  if (estimates) return;
  const scale::Measured found = wide->measure({{}, {}, false, given_noise_}, stop).measured;
  tell(found.estimate, found.bounds, wide->zones().float_step());
  of_zones = found.estimate;
}

Params Pipeline::State::resolve_in_zones(const Params& params, const std::stop_token& stop) {
  check_params(params);
  const scale::WideMeasured found =
      wide->measure({params, sensor_of(wide_viewpoints), seeks_sensor_, given_noise_}, stop);
  const scale::Measured& measured = found.measured;
  refuse_unmeasured(params, measured.estimate, measured.bounds.valid);
  return found.params;
}

void Pipeline::State::check_normals_in_zones(const std::stop_token& stop) {
  measure_in_zones(stop);
  const double step = scale::float_step_around(shell.source->sample(), shell.origin);
  if (step > estimates->spacing)
    throw Error(ErrorKind::usage,
                "the cloud is too wide for normals, which are computed around one origin: there its coordinates step "
                "by " +
                    length_text(step, {}) + ", and points are " + length_text(estimates->spacing, {}) +
                    " apart; ask for those of parts that are less wide");
}

void Pipeline::State::run_for_normals(const std::stop_token& stop) {
  if (!wide_run) return;
  check_normals_in_zones(stop);
  const Report report_of_zones = report;
  std::vector<std::uint8_t> marks = outliers;
  std::vector<Point> unused(cloud.points());
  run(*wide_run, unused, stop, {});
  wide_run.reset();
  report = report_of_zones;
  outliers = std::move(marks);
}

}  // namespace pointfair
