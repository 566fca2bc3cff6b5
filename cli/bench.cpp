// SPDX-License-Identifier: Apache-2.0
// pointfair bench: the time of each stage on this machine, from array to array. Without parameters, of the default run
// with its estimates, and then of k = 8 in one iteration.
#include <fmt/format.h>

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

// Whether a run also estimates what its parameters leave to the data, as those of users do.
enum class Estimation { before, in_each_run };

// One table: the medians over the repeats.
struct Times {
  Report report;
  Estimation when;
  std::vector<StageTime> stages;
  double total = 0;
  double similarity_only = 0;  // a further run in which only similarity_sigma changed
  double estimation = 0;       // index and estimates, once, before all else
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
  for (const auto& run : runs)
    for (const StageTime& stage : run) samples[stage.name].push_back(stage.milliseconds);
  std::vector<StageTime> result = runs.front();
  for (StageTime& stage : result) stage.milliseconds = median(samples[stage.name]);
  return result;
}

// Each repeat loads the points anew; the first one warms up and does not count.
Times measure(Pipeline& pipeline, std::span<const Point> points, const Params& asked, Estimation when, int repeat,
              std::stop_token stop) {
  Report report;
  Params resolved;
  const double estimation = milliseconds([&] {
    pipeline.load(points);
    resolved = pipeline.resolve(asked, stop);
  });
  const Params& params = when == Estimation::before ? resolved : asked;
  Params changed = params;
  changed.similarity_sigma = 1.25 * resolved.similarity_sigma.value;
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
  return {report, when, stage_medians(stages), median(totals), median(similarity_only), estimation};
}

// "all within a radius, 2 iterations".
std::string run_text(const Params& params) {
  const std::string neighbors = params.k > 0 ? fmt::format("k {}", params.k) : "neighbours within a radius";
  return fmt::format("{}, {} iteration{}", neighbors, params.iterations, params.iterations == 1 ? "" : "s");
}

std::string bench_text(std::string_view title, const Times& times, int repeat) {
  const Report& report = times.report;
  std::string text = fmt::format("{}: {}\n{} points, {}, median of {}\n", title, run_text(report.params), report.points,
                                 report.device.name, repeat);
  const auto out = std::back_inserter(text);
  for (const StageTime& stage : times.stages)
    fmt::format_to(out, "{:<22}{:10.1f} ms\n", stage.name, stage.milliseconds);
  fmt::format_to(out, "{:<22}{:10.1f} ms  {:.2f} million points a second\n", "array to array", times.total,
                 static_cast<double>(report.points) / times.total / 1000);
  fmt::format_to(out, "{:<22}{:10.1f} ms\n", "similarity_sigma only", times.similarity_only);
  fmt::format_to(out, "{:<22}{:10.1f} ms  {}\n", "index and estimates", times.estimation,
                 times.when == Estimation::before ? "once before, not included" : "included");
  fmt::format_to(out, "peak memory {:.1f} bytes a point on the host, {:.1f} on the device\n",
                 static_cast<double>(report.peak_host_bytes) / static_cast<double>(report.points),
                 static_cast<double>(report.peak_device_bytes) / static_cast<double>(report.points));
  return text;
}

Json bench_json(const Times& times) {
  const Report& report = times.report;
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
  const bool is_asked = !arguments.params.preset.empty() || !arguments.params.given.empty();
  const Params params = make_params(arguments.params, {});
  check_report(arguments.report, {arguments.input});
  Pipeline pipeline(make_device(arguments.device));
  const std::vector<Point> points =
      arguments.input.empty() ? make_cloud(arguments.points) : std::move(read(arguments.input).points);
  if (points.empty()) throw Error(ErrorKind::failed, "there are no points to time");
  const Times times = measure(pipeline, points, params, is_asked ? Estimation::before : Estimation::in_each_run,
                              arguments.repeat, stop);
  Json json = bench_json(times);
  std::string text = bench_text(is_asked ? "as asked" : "the default run", times, arguments.repeat);
  if (!is_asked) {
    const Times of_lists =
        measure(pipeline, points, {.k = 8, .iterations = 1}, Estimation::before, arguments.repeat, stop);
    json["k8"] = bench_json(of_lists);
    text += "\n" + bench_text("the least run", of_lists, arguments.repeat);
  }
  write_report(arguments.report, json);
  if (arguments.report != "-") print_output(text);
}

}  // namespace

Verb add_bench(CLI::App& app) {
  const auto arguments = std::make_shared<BenchArguments>();
  CLI::App& command = *app.add_subcommand("bench", "Time each stage on this machine.");
  command
      .add_option("--input", arguments->input,
                  "cloud to read; default: a bumpy sphere in random order with noise of one spacing")
      ->type_name("FILE");
  command.add_option("--points", arguments->points, "number of points of the bumpy sphere")
      ->check(whole_number_from(1))
      ->type_name("N")
      ->excludes("--input");
  command.add_option("--repeat", arguments->repeat, "number of runs that are timed, after one to warm up")
      ->check(CLI::Range(1, 1000).description(""))
      ->type_name("N");
  add_params(command, arguments->params);
  add_device(command, arguments->device);
  add_report(command, arguments->report);
  return {&command, [arguments](std::stop_token stop) { bench(*arguments, stop); }};
}

}  // namespace pointfair::cli
