// SPDX-License-Identifier: Apache-2.0
#include "run_in_memory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "command_line.hpp"
#include "output.hpp"
#include "point_noise.hpp"
#include "pointfair/pointfair.hpp"
#include "result_page.hpp"

namespace pointfair::cli {
namespace {

// Refuses before the run what would fail after it.
void check_normals(const RunArguments& arguments, const Cloud& cloud, const WriteOptions& options) {
  if (arguments.normals != "keep") check_new_normals(cloud, options.format);
  if (arguments.normals == "update" && normal_attributes(cloud).empty())
    throw Error(ErrorKind::usage,
                fmt::format("--normals update: {} has no normals; --normals write adds them", arguments.input));
}

// The normals of the last iteration. Where the file has its own, points that were not to move keep theirs.
void give_normals(Pipeline& pipeline, bool orient, std::span<const std::uint8_t> movable,
                  std::span<const Position> viewpoints, std::stop_token stop, Cloud& cloud) {
  std::vector<Point> normals(cloud.points.size());
  pipeline.normals(normals, stop);
  if (orient) orient_normals(cloud, normals, viewpoints, stop);
  const bool has_own = !normal_attributes(cloud).empty();
  for (std::size_t i = 0; has_own && i < movable.size(); ++i)
    if (!movable[i]) normals[i] = {0, 0, 0};
  set_normals(cloud, normals, viewpoints, orient ? NormalSigns::as_given : NormalSigns::by_rules);
}

WriteOptions write_options_of(const RunArguments& arguments) {
  WriteOptions options = make_write_options(arguments.format, arguments.output);
  options.las_scale = arguments.las_scale;
  options.overwrite = arguments.force;
  options.threads = arguments.device.threads;
  return options;
}

// The pipeline refuses files in degrees. Where nothing is to move, degrees do no harm, so it gets the points alone
// then.
void load(const Limits& limits, const Cloud& cloud, Pipeline& pipeline) {
  if (limits.strength > 0) check_not_geographic(cloud);
  if (file_info(cloud).is_geographic) {
    Cloud without_file = without_ignored(limits, cloud);
    without_file.source.reset();
    return pipeline.load(without_file);
  }
  if (limits.ignore.empty()) return pipeline.load(cloud);
  pipeline.load(without_ignored(limits, cloud));
}

// A page compares points by their order.
void check_order(const RunArguments& arguments, const Cloud& cloud, const WriteOptions& options) {
  if (!is_page(arguments.report)) return;
  const Format format = options.format ? *options.format : format_to_write(arguments.output, file_info(cloud).format);
  if (!keeps_order(cloud, format))
    throw Error(ErrorKind::usage,
                "a page compares points by their order, which is that of an octree in COPC files; write LAZ, and make "
                "the COPC file of that");
}

// Of the output. What is said of the input holds for a copy of it.
ReadOptions reading_of_output(const RunArguments& arguments, const Cloud& cloud, const WriteOptions& options) {
  const std::optional<Format> own = file_info(cloud).format;
  const Format format = options.format ? *options.format : format_to_write(arguments.output, own);
  ReadOptions reading{.threads = arguments.device.threads};
  if (format == own) reading = make_read_options(arguments.in, arguments.device.threads);
  reading.format = format;
  return reading;
}

// Whether the output has the points of the input and nothing that a run finds.
bool only_copies(const RunArguments& arguments, const Params& params, const Limits& limits) {
  return limits.strength == 0 && params.outliers != Outliers::mark && arguments.normals == "keep" &&
         arguments.write_noise.empty() && arguments.outlier_action.kind == OutlierAction::Kind::none &&
         !is_page(arguments.report);
}

// Why points are outliers. Those that the limits hold keep their class, and stay.
std::vector<std::uint8_t> reasons_of(std::span<const std::uint8_t> outliers, std::span<const std::uint8_t> movable) {
  std::vector<std::uint8_t> reasons(outliers.begin(), outliers.end());
  for (std::size_t i = 0; i < movable.size(); ++i)
    if (!movable[i]) reasons[i] = 0;
  return reasons;
}

// Points that the limits hold and that did not move before the limits acted.
std::uint64_t count_stayed(std::span<const std::uint8_t> movable, const Cloud& before, const Cloud& after) {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < movable.size(); ++i) {
    const Point &p = before.points[i], &q = after.points[i];
    count += !movable[i] && p.x == q.x && p.y == q.y && p.z == q.z;
  }
  return count;
}

// Where a run takes a mesh as a cloud.
std::vector<std::string> ignored_faces(const Params& params, const Limits& limits, const Cloud& cloud) {
  if (params.connectivity != Connectivity::automatic || limits.strength == 0) return {};
  return notes_on_faces(cloud);
}

void add(const std::vector<std::string>& notes, Findings& findings) {
  findings.notes.insert(findings.notes.end(), notes.begin(), notes.end());
}

}  // namespace

Cloud read_input(const RunArguments& arguments) {
  return read(arguments.input, make_read_options(arguments.in, arguments.device.threads));
}

void run_in_memory(const RunArguments& arguments, const Params& params, const Limits& limits, const Cloud& cloud,
                   Pipeline& pipeline, Progress& progress, Findings& findings, std::stop_token stop) {
  const WriteOptions write_options = write_options_of(arguments);
  check_normals(arguments, cloud, write_options);
  check_write(arguments.output, cloud, write_options);
  check_order(arguments, cloud, write_options);
  check_outlier_action(arguments.outlier_action, params.outliers, cloud, arguments.output, write_options);
  if (!arguments.write_noise.empty()) check_new_attribute(cloud, "--write-noise", arguments.write_noise, write_options);
  if (!arguments.write_displacement.empty())
    check_new_attribute(cloud, "--write-displacement", arguments.write_displacement, write_options);
  const std::vector<std::uint8_t> movable = movable_points(limits, cloud);
  load(limits, cloud, pipeline);
  if (!findings.noise_attribute.empty())
    use_noise_attribute(cloud, findings.noise_attribute, arguments.input, pipeline);
  std::vector<Position> viewpoints;  // where another was given than the file's
  if (!arguments.viewpoint.empty()) pipeline.set_viewpoint(viewpoints = parse_viewpoints(arguments.viewpoint, cloud));
  if (arguments.normals != "keep") pipeline.check_normals(params, stop);
  const bool copies = only_copies(arguments, params, limits);
  const bool tells = !arguments.quiet || !arguments.report.empty() || arguments.each;
  const bool acts = arguments.outlier_action.kind != OutlierAction::Kind::none;
  // so that outliers are known; the moved points have the same bits
  const bool marks = !acts && params.outliers != Outliers::mark && keeps_outliers(params) &&
                     (is_page(arguments.report) || (tells && !copies && !movable.empty()));
  Params with_marks = params;
  if (marks) with_marks.outliers = Outliers::mark;
  if (copies) in_file_units(params, file_info(cloud).metres_per_unit);  // throws as a run does
  Cloud denoised = copies ? cloud : pipeline.run(with_marks, stop, [&](double share, std::string_view stage) {
    progress.show(share, stage);
  });
  if (!denoised.source) denoised.source = cloud.source;
  // the file gets classes, flags or no attribute
  if ((marks || acts) && !pipeline.outliers().empty()) denoised.added.pop_back();
  const std::uint64_t on_boundary = pipeline.report().unmoved.boundary;
  const std::uint64_t stayed = on_boundary > 0 ? count_stayed(movable, cloud, denoised) : 0;
  apply_limits(limits, movable, cloud, denoised);
  if (arguments.normals != "keep") give_normals(pipeline, arguments.orient, movable, viewpoints, stop, denoised);
  if (!arguments.write_noise.empty()) write_noise_attribute(pipeline, params, arguments.write_noise, stop, denoised);
  if (!arguments.write_displacement.empty())
    write_displacement_attribute(cloud, arguments.write_displacement, denoised);
  std::vector<std::string> acted;
  std::optional<Cloud> remaining;
  std::vector<std::uint8_t> reasons;  // of outliers
  if (acts) {
    reasons = reasons_of(pipeline.outliers(), movable);
    const std::vector<Point> seen = limits.ignore.empty() ? cloud.points : without_ignored(limits, cloud).points;
    const OutlierOutcome outcome = act_on_outliers(arguments.outlier_action, reasons, seen, denoised);
    acted.push_back(outcome_text(arguments.outlier_action, outcome));
    // without one, the file stays a copy, whatever its format
    if (arguments.outlier_action.kind == OutlierAction::Kind::remove && outcome.outliers() > 0) {
      remaining = without_points(denoised, reasons);
      findings.removed = {outcome.of_reason[1], outcome.of_reason[2], outcome.of_reason[3]};
      for (const std::string& loss : losses(*remaining, write_options.format, write_options.encoding))
        acted.push_back(loss);
    }
  }
  progress.show(1, "writing");
  write(arguments.output, remaining ? *remaining : denoised, write_options);
  if (tells) {
    progress.show(1, "measuring");
    count_limited(cloud, limits, movable, pipeline.outliers(), findings);
    findings.held -= std::min({findings.held, stayed, on_boundary});  // which is counted among those that stay anyway
    std::vector<std::string> beside = notes_on_waveforms(cloud);
    std::ranges::move(notes_on_materials(cloud, arguments.input, arguments.output, write_options.format),
                      std::back_inserter(beside));
    if (copies) {
      find_copied(write_options, denoised, pipeline, findings);
      return add(beside, findings);
    }
    std::ranges::move(notes_on_units(cloud), std::back_inserter(beside));
    find_out(arguments.normals == "keep", write_options, cloud, denoised, pipeline, stop, findings);
    add(notes_on_viewpoints(arguments.viewpoint.empty() ? file_viewpoints(cloud) : viewpoints, cloud.origin,
                            pipeline.estimates(stop)),
        findings);
    if (arguments.normals != "keep") add(notes_on_one_origin(pipeline.report()), findings);
    if (arguments.viewpoint.empty() && !pipeline.report().found_sensor) add(notes_on_grid(cloud), findings);
    add(ignored_faces(params, limits, cloud), findings);
    add(beside, findings);
    for (const std::string& note : acted)
      if (std::ranges::find(findings.notes, note) == findings.notes.end()) findings.notes.push_back(note);
    findings.report = pipeline.report();
    if (marks) findings.report.params.outliers = Outliers::keep;
  }
  if (!is_page(arguments.report)) return;
  progress.show(1, "drawing");
  std::vector<std::string> notes = findings.notes;
  std::ranges::copy(findings.page_notes, notes.begin());
  const PageJob job{arguments.input,
                    arguments.output,
                    reading_of_output(arguments, cloud, write_options),
                    command_text(),
                    &findings.report,
                    findings.asked,
                    findings.noise_attribute,
                    notes,
                    {pipeline.outliers().begin(), pipeline.outliers().end()},
                    remaining ? reasons : std::vector<std::uint8_t>{},
                    findings.held};
  write_text(arguments.report, result_page(job, cloud, pipeline, stop).text);
}

}  // namespace pointfair::cli
