// SPDX-License-Identifier: Apache-2.0
// pointfair run IN OUT: denoise a cloud.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <memory>

#include "arguments.hpp"
#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "statistics.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct RunArguments {
  std::string input, output, report, progress = "auto";
  ParamArguments params;
  LimitArguments limits;
  DeviceArguments device;
  FormatArguments format;
  bool force = false, quiet = false, verbose = false;
};

// What is said about a run beside the library's own report.
struct Findings {
  double spacing = 0, noise = 0;  // of the input
  std::array<double, 3> noise_quantiles{};
  Statistics displacement;
};

void check_paths(const RunArguments& arguments) {
  if (arguments.report == "-" && arguments.output == "-") {
    throw Error(ErrorKind::usage, "the cloud and the report cannot both go to standard output; give --report a file");
  }
  if (!arguments.force) {
    check_not_same(arguments.input, arguments.output, "name another output, or add --force to replace the input");
  }
  check_writable(arguments.output, arguments.force);
  check_report(arguments.report, {arguments.input, arguments.output});
}

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

Json unmoved_json(const UnmovedCounts& unmoved) {
  return {{"non_finite", unmoved.non_finite},
          {"too_few_neighbors", unmoved.too_few_neighbors},
          {"no_normal", unmoved.no_normal},
          {"outliers", unmoved.outliers}};
}

Json run_json(const Report& report, const Findings& findings) {
  return {{"version", version()},
          {"device", device_json(report.device)},
          {"points", report.points},
          {"params", params_json(report.params)},
          {"spacing", findings.spacing},
          {"noise", {{"before", findings.noise}, {"quantiles", findings.noise_quantiles}}},
          {"unmoved", unmoved_json(report.unmoved)},
          {"short_neighborhoods", report.short_neighborhoods},
          {"displacement", statistics_json(findings.displacement)},
          {"stages", stages_json(report.stages)},
          {"tiles", report.tiles},
          {"total_ms", report.total_milliseconds},
          {"peak_bytes", {{"host", report.peak_host_bytes}, {"device", report.peak_device_bytes}}}};
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
std::string reasons_kept(const UnmovedCounts& unmoved) {
  std::string reasons;
  const auto add = [&](std::uint64_t count, const char* reason) {
    if (count > 0) reasons += fmt::format("{}{} {}", reasons.empty() ? ": " : ", ", count, reason);
  };
  add(unmoved.non_finite, "not finite or beyond 1e18");
  add(unmoved.too_few_neighbors, "with too few neighbours");
  add(unmoved.no_normal, "without a normal");
  add(unmoved.outliers, "outliers");
  return reasons;
}

void print_summary(const RunArguments& arguments, const Report& report, const Findings& findings) {
  if (arguments.verbose) print_details(report);
  const UnmovedCounts& unmoved = report.unmoved;
  const std::uint64_t kept = unmoved.non_finite + unmoved.too_few_neighbors + unmoved.no_normal + unmoved.outliers;
  fmt::print(stderr, "{} points denoised on {} in {:.1f} ms, {} kept as they were{}\n", report.points - kept,
             device_name(report.device.kind), report.total_milliseconds, kept, reasons_kept(unmoved));
  if (report.tiles > 1)
    fmt::print(stderr, "computed in {} tiles, since the cloud does not fit into the device's memory\n", report.tiles);
  fmt::print(stderr, "noise of the input {:.4g} (estimated), points moved {:.4g} on average, {:.4g} at most\n",
             findings.noise, findings.displacement.mean, findings.displacement.max);
}

Cloud read_input(const RunArguments& arguments) {
  ReadOptions options;
  options.threads = arguments.device.threads;
  return read(arguments.input, options);
}

void run(const RunArguments& arguments, std::stop_token stop) {
  const Params params = make_params(arguments.params, {});
  const Limits limits = make_limits(arguments.limits);
  const Device device = make_device(arguments.device);
  check_paths(arguments);
  WriteOptions write_options = make_write_options(arguments.format, arguments.output);
  write_options.overwrite = arguments.force;
  write_options.threads = arguments.device.threads;
  Pipeline pipeline(device);
  Findings findings;
  const bool wants_findings = !arguments.quiet || !arguments.report.empty();
  {
    Progress progress(arguments.quiet ? "none" : arguments.progress);
    progress.show(0, "reading");
    const Cloud cloud = read_input(arguments);
    pipeline.load(cloud);
    Cloud denoised =
        pipeline.run(params, stop, [&](double share, std::string_view stage) { progress.show(share, stage); });
    apply_limits(limits, cloud, denoised);
    progress.show(1, "writing");
    write(arguments.output, denoised, write_options);
    if (wants_findings) {
      progress.show(1, "measuring");
      const Estimates& estimates = pipeline.estimates(stop);
      findings = {estimates.spacing, estimates.noise, estimates.noise_quantiles, displacement(cloud, denoised)};
    }
  }
  write_report(arguments.report, run_json(pipeline.report(), findings));
  if (!arguments.quiet) print_summary(arguments, pipeline.report(), findings);
}

}  // namespace

Verb add_run(CLI::App& app) {
  const auto arguments = std::make_shared<RunArguments>();
  CLI::App& command = *app.add_subcommand("run", "Denoise a cloud and keep its shape.");
  command.add_option("IN", arguments->input, "cloud to read; - is standard input")->required();
  command.add_option("OUT", arguments->output, "cloud to write; - is standard output")->required();
  add_params(command, arguments->params);
  add_limits(command, arguments->limits);
  add_device(command, arguments->device);
  add_format(command, arguments->format);
  add_report(command, arguments->report);
  add_choice(command, "--progress", arguments->progress, {std::begin(kProgressModes), std::end(kProgressModes)},
             "progress on standard error; auto: a bar on a terminal");
  command.add_flag("--force", arguments->force, "replace OUT if it exists");
  command.add_flag("-q,--quiet", arguments->quiet, "print errors only");
  command.add_flag("-v,--verbose", arguments->verbose, "print the device, the parameters and each stage's time");
  return {&command, [arguments](std::stop_token stop) { run(*arguments, stop); }};
}

}  // namespace pointfair::cli
