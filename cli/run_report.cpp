// SPDX-License-Identifier: Apache-2.0
#include "run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>

#include "output.hpp"
#include "point_noise.hpp"

namespace pointfair::cli {
namespace {

// Of the finite points, in file units.
Statistics displacement(const Cloud& before, const Cloud& after) {
  const std::size_t points = before.points.size();
  const auto memory = std::make_unique_for_overwrite<double[]>(points);  // first met by all threads
  const std::span lengths(memory.get(), points);
  displacements(before, after, lengths);
  const auto others = std::ranges::remove_if(lengths, [](double length) { return !std::isfinite(length); });
  return summarize(lengths.first(points - others.size()));
}

PointCounts point_counts(const Report& report, const Findings& findings) {
  PointCounts counts{report.points, report.unmoved, report.pulled, findings.removed, findings.ignored, findings.held};
  // Ignored points go into a run as points that are not finite.
  counts.unmoved.non_finite -= std::min(counts.unmoved.non_finite, findings.ignored);
  return counts;
}

Json mesh_json(const MeshReport& mesh) {
  if (mesh.faces == 0) return nullptr;
  return {{"faces", mesh.faces},
          {"vertices", mesh.vertices},
          {"degenerate_faces", mesh.degenerate_faces},
          {"boundary_edges", mesh.boundary_edges},
          {"non_manifold_edges", mesh.non_manifold_edges},
          {"boundary_vertices", mesh.boundary_vertices},
          {"isolated_points", mesh.isolated_points},
          {"folded_before", mesh.folded_before},
          {"folded_after", mesh.folded_after}};
}

Json solver_json(const SolverReport& solver) {
  if (solver.iterations == 0) return nullptr;
  return {{"iterations", solver.iterations}, {"residual", solver.residual}};
}

// "mesh of 1000 vertices and 1996 faces, 3 of them degenerate; folded faces: 12 before, 4 after"
std::string mesh_told(const MeshReport& mesh) {
  if (mesh.faces == 0) return {};
  std::string text = fmt::format("mesh of {} vertices and {} faces", mesh.vertices, mesh.faces);
  const auto add = [&](std::uint64_t count, const char* what) {
    if (count > 0) text += fmt::format(", {} {}", count, what);
  };
  add(mesh.degenerate_faces, "degenerate faces");
  add(mesh.non_manifold_edges, "edges of more than two faces");
  add(mesh.isolated_points, "points without a face");
  add(mesh.boundary_vertices, "vertices on its boundary");
  return text + fmt::format("; folded faces: {} before, {} after\n", mesh.folded_before, mesh.folded_after);
}

bool is_noise_given(const Findings& findings) {
  return findings.noise_attribute.empty() && !findings.asked.noise.is_automatic();
}

Json noise_json(const Report& report, const Findings& findings) {
  if (findings.is_copied) return {{"before", nullptr}, {"quantiles", nullptr}};
  Json json{{"before", findings.noise}, {"quantiles", findings.noise_quantiles}};
  if (!findings.noise_attribute.empty()) json["attribute"] = findings.noise_attribute;
  if (is_noise_given(findings)) json["given"] = report.params.noise.value;
  return json;
}

// Between the coordinates of the file written, where these are integers.
double written_step(const Cloud& cloud, const WriteOptions& options) {
  if (options.las_scale) return *options.las_scale;
  const auto is_las = [](Format format) {
    return format == Format::las || format == Format::laz || format == Format::copc;
  };
  const FileInfo info = file_info(cloud);
  const bool keeps = info.format && (!options.format || options.format == info.format ||
                                     (is_las(*options.format) && is_las(*info.format)));
  return keeps ? info.step : 0;
}

bool is_in_zones(const Report& report) { return !report.stages.empty() && report.stages[0].name == "zones"; }

// Where a run was done in zones.
std::string zones_note(const Cloud& cloud, const Report& report, const Estimates& estimates,
                       std::optional<double> metres_per_unit) {
  if (!is_in_zones(report)) return {};
  return fmt::format(
      "the cloud is too wide and dense for floats around one origin, so it is computed in zones where floats step by "
      "{}{}",
      length_text(estimates.float_step, metres_per_unit),
      file_viewpoints(cloud).size() > 1 ? ", and mixed pixels are not looked for" : "");
}

}  // namespace

void count_limited(const Cloud& cloud, const Limits& limits, std::span<const std::uint8_t> movable,
                   std::span<const std::uint8_t> outliers, Findings& findings) {
  std::vector<std::uint8_t> ignored(limits.ignore.empty() ? 0 : cloud.points.size());
  for (const Selection& selection : limits.ignore) {
    const std::vector<std::uint8_t> selected = selected_points(selection, cloud);
    for (std::size_t i = 0; i < ignored.size(); ++i) ignored[i] |= selected[i];
  }
  for (std::size_t i = 0; i < movable.size(); ++i) {
    if (movable[i] || !is_finite(cloud.points[i])) continue;
    if (!outliers.empty() && outliers[i] != 0) continue;  // counted among these
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
  findings.metres_per_unit = file_info(before).metres_per_unit;
  findings.displacement = displacement(before, after);
  const double noise = is_noise_given(findings) ? pipeline.report().params.noise.value : estimates.noise;
  const Statistics& moved = findings.displacement;
  const std::vector<std::string> lost = losses(after, options.format, options.encoding);
  const auto notes = [&](std::optional<double> metres_per_unit) {
    std::vector<std::string> result{nothing_selected(point_counts(pipeline.report(), findings))};
    const auto add = [&](const std::vector<std::string>& more) {
      result.insert(result.end(), more.begin(), more.end());
    };
    add(lost);
    if (keeps_normals && moved.max > 0) add(notes_on_kept_normals(after, options.format));
    add({coarse_steps(findings.step, noise, metres_per_unit),
         zones_note(before, pipeline.report(), estimates, metres_per_unit)});
    add(notes_on_run(findings.asked, estimates, pipeline.report(), {moved.mean, moved.rms, moved.p95, moved.max},
                     stored_float_step(before, estimates), metres_per_unit));
    std::erase(result, "");
    return result;
  };
  findings.notes = notes({});
  if (findings.metres_per_unit) findings.page_notes = notes(findings.metres_per_unit);
}

std::vector<std::string> notes_on_one_origin(const Report& report) {
  if (!is_in_zones(report)) return {};
  return {
      "new normals are computed around one origin all the same, where floats are too coarse for this cloud, so they "
      "may be wrong: write them of parts of it that are less wide"};
}

void find_copied(const WriteOptions& options, const Cloud& cloud, const Pipeline& pipeline, Findings& findings) {
  findings.is_copied = true;
  findings.report.device = pipeline.device();
  findings.report.points = cloud.points.size();
  findings.step = written_step(cloud, options);
  findings.metres_per_unit = file_info(cloud).metres_per_unit;
  findings.notes = losses(cloud, options.format, options.encoding);
}

Json run_json(const Report& report, const Findings& findings) {
  return {{"version", version()},
          {"device", device_json(report.device)},
          {"points", report.points},
          {"metres_per_unit", findings.metres_per_unit ? Json(*findings.metres_per_unit) : Json()},
          {"params", findings.is_copied ? Json() : params_json(report.params)},
          {"spacing", findings.is_copied ? Json() : Json(findings.spacing)},
          {"noise", noise_json(report, findings)},
          {"rounding", rounding_json(findings.step)},
          {"float_step", findings.float_step},
          {"unmoved", unmoved_json(point_counts(report, findings))},
          {"outliers", outliers_json(point_counts(report, findings))},
          {"found_sensor", report.found_sensor ? Json(*report.found_sensor) : Json()},
          {"pulled", report.pulled.total()},
          {"removed", findings.removed.total()},
          {"short_neighborhoods", report.short_neighborhoods},
          {"copies", report.copies},
          {"mesh", mesh_json(report.mesh)},
          {"solver", solver_json(report.solver)},
          {"displacement", statistics_json(findings.displacement)},
          {"stages", stages_json(report.stages)},
          {"tiles", report.tiles},
          {"total_ms", report.total_milliseconds},
          {"peak_bytes", {{"host", report.peak_host_bytes}, {"device", report.peak_device_bytes}}},
          {"notes", findings.notes}};
}

Told told_of(const Findings& findings) {
  const Report& report = findings.report;
  const auto measured = [&](double value) { return findings.is_copied ? std::nullopt : std::optional(value); };
  return {.is_copied = findings.is_copied,
          .points = report.points,
          .outliers = found_outliers(report),
          .spacing = measured(findings.spacing),
          .noise = measured(findings.noise),
          .moved_mean = findings.displacement.mean,
          .moved_max = findings.displacement.max,
          .milliseconds = report.total_milliseconds,
          .metres_per_unit = findings.metres_per_unit,
          .notes = findings.notes,
          .json = run_json(report, findings)};
}

void print_summary(const Report& report, const Findings& findings, bool with_details) {
  if (findings.is_copied) {
    print_message("{} points written as they were: --strength 0 moves none, so nothing was computed\n", report.points);
    for (const std::string& note : findings.notes) print_message("note: {}\n", note);
    return;
  }
  if (with_details) print_message("{}", details_told(report.device, findings.asked, report.params, report.stages));
  const PointCounts counts = point_counts(report, findings);
  print_message("{}", points_told(counts, fmt::format("on {} in {:.1f} ms", device_name(report.device.kind),
                                                      report.total_milliseconds)));
  if (report.tiles > 1)
    print_message("computed in {} tiles, since the cloud does not fit into the device's memory\n", report.tiles);
  print_message("{}{}",
                noise_and_moves(is_noise_given(findings) ? report.params.noise.value : findings.noise,
                                noise_source(findings.asked, findings.noise_attribute), findings.displacement.mean,
                                findings.displacement.max),
                rounding_text(findings.step));
  print_message("{}", mesh_told(report.mesh));
  if (const SolverReport& solver = report.solver; solver.iterations > 0)
    print_message("equations solved by {} iterations to a residual of {:.1g}\n", solver.iterations, solver.residual);
  for (const std::string& note : findings.notes) print_message("note: {}\n", note);
}

}  // namespace pointfair::cli
