// SPDX-License-Identifier: Apache-2.0
#include "run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace pointfair::cli {
namespace {

// Of the finite points, in file units.
Statistics displacement(const Cloud& before, const Cloud& after) {
  std::vector<double> lengths;
  lengths.reserve(before.points.size());
  for (std::size_t i = 0; i < before.points.size(); ++i) {
    const Point &p = before.points[i], &q = after.points[i];
    const double length = std::hypot(double{q.x} - p.x, double{q.y} - p.y, double{q.z} - p.z);
    if (std::isfinite(length)) lengths.push_back(length);
  }
  return summarize(lengths);
}

// Ignored points go into a run as points that are not finite.
UnmovedCounts without(UnmovedCounts unmoved, std::uint64_t ignored) {
  unmoved.non_finite -= std::min(unmoved.non_finite, ignored);
  return unmoved;
}

Json unmoved_json(const UnmovedCounts& unmoved, const Findings& findings) {
  return {{"non_finite", unmoved.non_finite}, {"too_few_neighbors", unmoved.too_few_neighbors},
          {"no_normal", unmoved.no_normal},   {"outliers", unmoved.outliers},
          {"ignored", findings.ignored},      {"held", findings.held}};
}

Json noise_json(const Findings& findings) {
  Json json{{"before", findings.noise}, {"quantiles", findings.noise_quantiles}};
  if (!findings.noise_attribute.empty()) json["attribute"] = findings.noise_attribute;
  return json;
}

void print_details(const Report& report) {
  fmt::print(stderr, "device    {}, {} ({})\n", device_name(report.device.kind), report.device.name,
             report.device.reason);
  for (const ParamInfo& info : kParams) {
    fmt::print(stderr, "  {:<18} {}\n", info.name, param_text(report.params, info));
  }
  for (const StageTime& stage : report.stages)
    fmt::print(stderr, "  {:<18} {:.1f} ms\n", stage.name, stage.milliseconds);
}

// Why points kept their place.
std::string reasons_kept(const UnmovedCounts& unmoved, std::uint64_t ignored) {
  std::string reasons;
  const auto add = [&](std::uint64_t count, const char* reason) {
    if (count > 0) reasons += fmt::format("{}{} {}", reasons.empty() ? ": " : ", ", count, reason);
  };
  add(unmoved.non_finite, "not finite or beyond 1e18");
  add(unmoved.too_few_neighbors, "with too few neighbours");
  add(unmoved.no_normal, "without a normal");
  const OutlierCounts& outliers = unmoved.outliers_by_reason;
  add(outliers.isolated, "isolated");
  add(outliers.off_surface, "off the surface");
  add(outliers.mixed_pixels, "mixed pixels");
  add(ignored, "ignored");
  return reasons;
}

// Between the coordinates of the file written, where these are integers.
double written_step(const Cloud& cloud, const WriteOptions& options) {
  if (options.las_scale) return *options.las_scale;
  const auto is_las = [](Format format) { return format == Format::las || format == Format::laz; };
  const FileInfo info = file_info(cloud);
  const bool keeps = info.format && (!options.format || options.format == info.format ||
                                     (is_las(*options.format) && is_las(*info.format)));
  return keeps ? info.step : 0;
}

std::vector<std::string> notes(bool keeps_normals, const WriteOptions& options, const Cloud& cloud,
                               const Findings& findings) {
  std::vector<std::string> result = losses(cloud, options.format, options.encoding);
  if (keeps_normals && findings.displacement.max > 0 && !normal_attributes(cloud).empty())
    result.push_back("the normals in the file are those from before; --normals update replaces them");
  if (const std::string coarse = coarse_steps(findings.step, findings.noise); !coarse.empty()) result.push_back(coarse);
  if (const std::string coarse = coarse_floats(findings.float_step, findings.noise); !coarse.empty())
    result.push_back(coarse);
  return result;
}

}  // namespace

void count_limited(const Cloud& cloud, const Limits& limits, std::span<const std::uint8_t> movable,
                   Findings& findings) {
  const auto is_finite = [](const Point& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); };
  std::vector<std::uint8_t> ignored(limits.ignore.empty() ? 0 : cloud.points.size());
  for (const Selection& selection : limits.ignore) {
    const std::vector<std::uint8_t> selected = selected_points(selection, cloud);
    for (std::size_t i = 0; i < ignored.size(); ++i) ignored[i] |= selected[i];
  }
  for (std::size_t i = 0; i < movable.size(); ++i) {
    if (movable[i] || !is_finite(cloud.points[i])) continue;
    ++(!ignored.empty() && ignored[i] ? findings.ignored : findings.held);
  }
}

void find_out(bool keeps_normals, const WriteOptions& options, const Cloud& before, const Cloud& after,
              Pipeline& pipeline, std::stop_token stop, Findings& findings) {
  const Estimates& estimates = pipeline.estimates(stop);
  findings.spacing = estimates.spacing;
  findings.noise = estimates.noise;
  findings.noise_quantiles = estimates.noise_quantiles;
  findings.step = written_step(before, options);
  findings.float_step = estimates.float_step;
  findings.displacement = displacement(before, after);
  findings.notes = notes(keeps_normals, options, before, findings);
}

Json run_json(const Report& report, const Findings& findings) {
  return {{"version", version()},
          {"device", device_json(report.device)},
          {"points", report.points},
          {"params", params_json(report.params)},
          {"spacing", findings.spacing},
          {"noise", noise_json(findings)},
          {"rounding", rounding_json(findings.step)},
          {"float_step", findings.float_step},
          {"unmoved", unmoved_json(without(report.unmoved, findings.ignored), findings)},
          {"outliers", outliers_json(report.unmoved.outliers_by_reason)},
          {"short_neighborhoods", report.short_neighborhoods},
          {"displacement", statistics_json(findings.displacement)},
          {"stages", stages_json(report.stages)},
          {"tiles", report.tiles},
          {"total_ms", report.total_milliseconds},
          {"peak_bytes", {{"host", report.peak_host_bytes}, {"device", report.peak_device_bytes}}}};
}

void print_summary(const Report& report, const Findings& findings, bool with_details) {
  if (with_details) print_details(report);
  const UnmovedCounts unmoved = without(report.unmoved, findings.ignored);
  const std::uint64_t kept =
      unmoved.non_finite + unmoved.too_few_neighbors + unmoved.no_normal + unmoved.outliers + findings.ignored;
  fmt::print(stderr, "{} points denoised on {} in {:.1f} ms, {} kept as they were{}\n",
             count_denoised(report.points, kept, findings.held), device_name(report.device.kind),
             report.total_milliseconds, kept, reasons_kept(unmoved, findings.ignored));
  if (findings.held > 0)
    fmt::print(stderr, "limits, such as --where and --box, held {} points in place\n", findings.held);
  if (report.tiles > 1)
    fmt::print(stderr, "computed in {} tiles, since the cloud does not fit into the device's memory\n", report.tiles);
  fmt::print(
      stderr, "{}{}",
      noise_and_moves(findings.noise, findings.noise_attribute, findings.displacement.mean, findings.displacement.max),
      rounding_text(findings.step));
  const std::string none = nothing_selected(report.points, unmoved.non_finite, findings.ignored, findings.held);
  if (!none.empty()) fmt::print(stderr, "note: {}\n", none);
  for (const std::string& note : findings.notes) fmt::print(stderr, "note: {}\n", note);
}

}  // namespace pointfair::cli
