// SPDX-License-Identifier: Apache-2.0
#include "tiled.hpp"

#include <fmt/format.h>

#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>

#include "interrupts.hpp"
#include "outlier_action.hpp"
#include "output.hpp"
#include "platform/system.hpp"
#include "pointfair/pointfair.hpp"
#include "progress.hpp"
#include "report.hpp"

namespace pointfair::cli {
namespace fs = std::filesystem;
namespace {

constexpr std::uint64_t kLeastMemory = std::uint64_t{64} << 20;

// A folder that goes when this does.
class ScratchFolder {
 public:
  explicit ScratchFolder(const fs::path& beside) : path_(TiledRun::make_scratch_folder(beside)) {
    remove_if_ended(path_);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
    remove_if_ended({});
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// What a run in one process took.
struct Costs {
  std::vector<StageTime> steps;
  double milliseconds = 0;
  std::uint64_t peak_bytes = 0;  // of the process
};

// Times the steps of a run, each from its beginning to that of the next.
class StepClock {
 public:
  void enter(std::string_view step) {
    if (!steps_.empty() && steps_.back().name == step) return;
    end_step();
    steps_.push_back({std::string(step), 0});
    begin_ = Clock::now();
  }
  Costs stop() {
    end_step();
    Costs costs{std::move(steps_)};
    for (const StageTime& step : costs.steps) costs.milliseconds += step.milliseconds;
    costs.peak_bytes = system::peak_memory();
    return costs;
  }

 private:
  using Clock = std::chrono::steady_clock;
  void end_step() {
    if (steps_.empty()) return;
    steps_.back().milliseconds = std::chrono::duration<double, std::milli>(Clock::now() - begin_).count();
  }

  std::vector<StageTime> steps_;
  Clock::time_point begin_;
};

// The noise, if --noise gave it as a length; none if it was estimated or read from an attribute.
std::optional<double> given_noise(const TiledReport& report) {
  const Length& noise = report.params.noise;
  const bool is_given =
      report.noise_attribute.empty() && !report.asked.noise.is_automatic() && noise.unit == Length::Unit::file;
  return is_given ? std::optional(noise.value) : std::nullopt;
}

Json noise_json(const TiledReport& report) {
  Json json{{"before", report.noise ? Json(*report.noise) : Json()},
            {"quantiles", report.noise ? Json(report.noise_quantiles) : Json()}};
  if (!report.noise_attribute.empty()) json["attribute"] = report.noise_attribute;
  if (const std::optional<double> given = given_noise(report)) json["given"] = *given;
  return json;
}

PointCounts point_counts(const TiledReport& report) {
  const auto& of_reason = report.outcome.of_reason;
  const bool removes = report.outlier_action.kind == OutlierAction::Kind::remove;
  return {report.points,  report.unmoved,
          report.pulled,  removes ? OutlierCounts{of_reason[1], of_reason[2], of_reason[3]} : OutlierCounts(),
          report.ignored, report.held};
}

std::vector<std::string> notes_of(const TiledReport& report) {
  const double noise = given_noise(report).value_or(report.noise.value_or(0));
  std::vector<std::string> notes = {nothing_selected(point_counts(report))};
  notes.insert(notes.end(), report.notes_on_files.begin(), report.notes_on_files.end());
  notes.push_back(coarse_steps(report.step, noise));
  const std::vector<std::string> doubtful = notes_on_run(report);
  notes.insert(notes.end(), doubtful.begin(), doubtful.end());
  if (report.outlier_action.kind != OutlierAction::Kind::none)
    notes.push_back(outcome_text(report.outlier_action, report.outcome));
  std::erase(notes, "");
  return notes;
}

// `costs`: null where other processes did tasks.
Json report_json(const TiledReport& report, const DeviceInfo& device, const Costs* costs) {
  const Displacement& moved = report.displacement;
  return {{"version", version()},
          {"device", device_json(device)},
          {"points", report.points},
          {"metres_per_unit", report.metres_per_unit ? Json(*report.metres_per_unit) : Json()},
          {"params", params_json(report.params)},
          {"spacing", report.spacing ? Json(*report.spacing) : Json()},
          {"noise", noise_json(report)},
          {"rounding", rounding_json(report.step)},
          {"float_step", report.float_step},
          {"unmoved", unmoved_json(point_counts(report))},
          {"outliers", outliers_json(point_counts(report))},
          {"found_sensor", report.found_sensor ? Json(*report.found_sensor) : Json()},
          {"pulled", report.pulled.total()},
          {"removed", point_counts(report).removed.total()},
          {"short_neighborhoods", report.short_neighborhoods},
          {"copies", report.copies},
          {"mesh", nullptr},
          {"solver", nullptr},
          {"displacement", statistics_json({moved.mean, moved.rms, moved.p95, moved.max})},
          {"stages", costs ? stages_json(costs->steps) : Json()},
          {"tiles", report.tiles},
          {"total_ms", costs ? Json(costs->milliseconds) : Json()},
          {"peak_bytes", {{"host", costs ? Json(costs->peak_bytes) : Json()}, {"device", Json()}}},
          {"notes", notes_of(report)}};
}

void print_summary(const TiledReport& report) {
  const PointCounts counts = point_counts(report);
  print_message("{}", points_told(counts, fmt::format("in {} {}", report.tiles, report.tiles == 1 ? "tile" : "tiles")));
  const std::optional<double> given = given_noise(report);
  const std::string source = noise_source(report.asked, report.noise_attribute);
  print_message(
      "{}{}", noise_and_moves(given ? given : report.noise, source, report.displacement.mean, report.displacement.max),
      rounding_text(report.step));
  for (const std::string& note : notes_of(report)) print_message("note: {}\n", note);
}

void tell(const TiledReport& report, const Device& device, const TiledOutput& output, const Costs* costs) {
  const DeviceInfo info = Pipeline(device).device();
  if (!output.report.empty()) write_report(output.report, report_json(report, info, costs));
  if (output.quiet) return;
  if (output.verbose && costs) print_message("{}", details_told(info, report.asked, report.params, costs->steps));
  print_summary(report);
}

}  // namespace

std::uint64_t memory_to_use(const TiledArguments& arguments) {
  const std::string& text = arguments.memory;
  if (text.empty()) return 0;
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  std::string unit(end, text.data() + text.size());
  if (!unit.empty() && unit.back() == 'B') unit.pop_back();
  const int shift = unit.empty() ? 0 : unit == "K" ? 10 : unit == "M" ? 20 : unit == "G" ? 30 : unit == "T" ? 40 : -1;
  if (error != std::errc() || shift < 0 || !(value > 0) || !(std::ldexp(value, shift) < 1e18))
    throw Error(ErrorKind::usage, fmt::format("--memory {}: give a size such as 8G or 512M", text));
  const auto bytes = static_cast<std::uint64_t>(std::ldexp(value, shift));
  if (bytes < kLeastMemory) throw Error(ErrorKind::usage, fmt::format("--memory {}: at least 64M is needed", text));
  return bytes;
}

void run_in_tiles(const TiledJob& job, const fs::path& work, const Device& device, const TiledOutput& output,
                  std::stop_token stop) {
  StepClock clock;
  clock.enter("plan");
  system::keep_no_freed_memory();
  std::optional<ScratchFolder> scratch;
  if (work.empty()) {
    fs::path beside = job.output_folder.empty() ? job.output.parent_path() : job.output_folder;
    if (beside.empty()) beside = ".";
    scratch.emplace(beside);
  }
  const fs::path folder = scratch ? scratch->path() : work;
  TiledReport report;
  {
    Progress progress(output.quiet ? "none" : output.progress);
    progress.show(0, "planning");
    TiledRun::plan(job, folder, device.threads);
    if (!output.quiet && !output.note.empty()) print_message("note: {}\n", output.note);
    TiledRun run(folder, device);
    run.run_all(stop, [&](double share, std::string_view step) {
      clock.enter(step);
      progress.show(share, step);
    });
    report = run.report();
  }
  const Costs costs = clock.stop();
  tell(report, device, output, &costs);
}

void finish_tiles(const TiledRun& run, const Device& device, const TiledOutput& output) {
  tell(run.report(), device, output, nullptr);
}

}  // namespace pointfair::cli
