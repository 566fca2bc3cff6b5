// SPDX-License-Identifier: Apache-2.0
// pointfair bench: the time of each stage on this machine, from array to array.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <numbers>

#include "arguments.hpp"
#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "report.hpp"
#include "sampling.hpp"
#include "statistics.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct BenchArguments {
  std::string input, report;
  std::uint64_t points = 1'000'000;
  int repeat = 5;
  ParamArguments params;
  DeviceArguments device;
};

// Medians over the repeats.
struct Times {
  std::vector<StageTime> stages;
  double total = 0;
  double similarity_only = 0;  // a further run in which only similarity_sigma changed
  double estimation = 0;       // of the automatic parameters, once, before all else
};

template <class F>
double milliseconds(const F& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// Noise of one spacing, the side of the square that each point has of the sphere: 0.1 % of the diagonal at a million
// points. So clouds of every size look alike from close by, and their times compare.
std::vector<Point> make_cloud(std::uint64_t count) {
  std::vector<Point> points = sample_bumpy_sphere(count, 1);
  add_noise(points, std::sqrt(4 * std::numbers::pi / static_cast<double>(count)), 1);
  return points;
}

// The stages of several runs, in the order of the first, each with its median.
std::vector<StageTime> stage_medians(const std::vector<std::vector<StageTime>>& runs) {
  std::map<std::string, std::vector<double>> samples;
  for (const auto& run : runs) {
    for (const StageTime& stage : run) samples[stage.name].push_back(stage.milliseconds);
  }
  std::vector<StageTime> result = runs.front();
  for (StageTime& stage : result) stage.milliseconds = median(samples[stage.name]);
  return result;
}

// Each repeat loads the points anew; the first one warms up and does not count. `params` has no auto left.
Times measure(Pipeline& pipeline, std::span<const Point> points, const Params& params, int repeat, Report& report,
              std::stop_token stop) {
  Params changed = params;
  changed.similarity_sigma.value *= 1.25;
  std::vector<Point> out(points.size());
  std::vector<std::vector<StageTime>> stages;
  std::vector<double> totals, similarity_only;
  for (int i = 0; i <= repeat; ++i) {
    const double total = milliseconds([&] {
      pipeline.load(points);
      pipeline.run(params, out, stop);
    });
    report = pipeline.report();
    const double last = milliseconds([&] { pipeline.run(changed, out, stop); });
    if (i == 0) continue;
    stages.push_back(report.stages);
    totals.push_back(total);
    similarity_only.push_back(last);
  }
  return {stage_medians(stages), median(totals), median(similarity_only), 0};
}

std::string bench_text(const Report& report, const Times& times, int repeat) {
  std::string text =
      fmt::format("{} points, k {}, {}, median of {}\n", report.points, report.params.k, report.device.name, repeat);
  const auto out = std::back_inserter(text);
  for (const StageTime& stage : times.stages)
    fmt::format_to(out, "{:<22}{:10.1f} ms\n", stage.name, stage.milliseconds);
  fmt::format_to(out, "{:<22}{:10.1f} ms  {:.2f} million points a second\n", "array to array", times.total,
                 static_cast<double>(report.points) / times.total / 1000);
  fmt::format_to(out, "{:<22}{:10.1f} ms\n", "similarity_sigma only", times.similarity_only);
  fmt::format_to(out, "automatic parameters were resolved once beforehand, {:.1f} ms, not included\n",
                 times.estimation);
  fmt::format_to(out, "peak memory {:.1f} bytes a point on the host, {:.1f} on the device\n",
                 static_cast<double>(report.peak_host_bytes) / static_cast<double>(report.points),
                 static_cast<double>(report.peak_device_bytes) / static_cast<double>(report.points));
  return text;
}

Json bench_json(const Report& report, const Times& times) {
  return {{"device", device_json(report.device)},
          {"points", report.points},
          {"k", report.params.k},
          {"params", params_json(report.params)},
          {"stages", stages_json(times.stages)},
          {"total_ms", times.total},
          {"similarity_only_ms", times.similarity_only},
          {"estimation_ms", times.estimation},
          {"peak_bytes", {{"host", report.peak_host_bytes}, {"device", report.peak_device_bytes}}}};
}

void bench(const BenchArguments& arguments, std::stop_token stop) {
  Params params;
  params.k = 8;
  params.passes = 1;
  params = make_params(arguments.params, params);
  check_report(arguments.report, {arguments.input});
  Pipeline pipeline(make_device(arguments.device));
  const std::vector<Point> points =
      arguments.input.empty() ? make_cloud(arguments.points) : std::move(read(arguments.input).points);
  if (points.empty()) throw Error(ErrorKind::failed, "there are no points to time");
  const double estimation = milliseconds([&] {
    pipeline.load(points);
    params = pipeline.resolve(params, stop);
  });
  Report report;
  Times times = measure(pipeline, points, params, arguments.repeat, report, stop);
  times.estimation = estimation;
  write_report(arguments.report, bench_json(report, times));
  if (arguments.report != "-") print_output(bench_text(report, times, arguments.repeat));
}

}  // namespace

Verb add_bench(CLI::App& app) {
  const auto arguments = std::make_shared<BenchArguments>();
  CLI::App& command = *app.add_subcommand("bench", "Time each stage and the whole, from array to array.");
  command
      .add_option("--input", arguments->input,
                  "cloud to read; default: a bumpy sphere, random order, noise of one spacing")
      ->type_name("FILE");
  command.add_option("--points", arguments->points, "of the bumpy sphere")->type_name("N")->excludes("--input");
  command.add_option("--repeat", arguments->repeat, "median of so many runs, after one to warm up")
      ->check(CLI::Range(1, 1000).description(""))
      ->type_name("N");
  add_params(command, arguments->params);
  add_device(command, arguments->device);
  add_report(command, arguments->report);
  return {&command, [arguments](std::stop_token stop) { bench(*arguments, stop); }};
}

}  // namespace pointfair::cli
