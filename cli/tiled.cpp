// SPDX-License-Identifier: Apache-2.0
#include "tiled.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>

#include "interrupts.hpp"
#include "outlier_action.hpp"
#include "output.hpp"
#include "platform/system.hpp"
#include "pointfair/pointfair.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "run_arguments.hpp"
#include "survey.hpp"

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

void tell(const TiledReport& report, const DeviceInfo& info, const TiledOutput& output, const Costs* costs) {
  if (!output.report.empty()) write_report(output.report, report_json(report, info, costs));
  if (output.quiet) return;
  if (output.verbose && costs) print_message("{}", details_told(info, report.asked, report.params, costs->steps));
  print_summary(report);
}

// A flag that tiles cannot follow; empty if there is none.
std::string flag_for_memory(const RunArguments& arguments) {
  if (arguments.normals != "keep") return "--normals " + arguments.normals;
  if (!arguments.write_noise.empty()) return "--write-noise";
  if (!arguments.write_displacement.empty()) return "--write-displacement";
  if (is_page(arguments.report)) return "--report " + arguments.report;
  if (!arguments.weights.empty()) return "--weights";
  if (arguments.in.any()) return "--in-format, --columns and --skip";
  return {};
}

[[noreturn]] void refuse(const std::string& flag, bool into_folder) {
  std::string text = flag + " cannot be used with a run in tiles on disk (--memory, --work, --out-dir)";
  if (into_folder) text += "; files of --out-dir are one cloud in tiles, and --each treats every file on its own";
  if (flag.starts_with("--report"))
    text = flag + ": a run in tiles on disk writes JSON; make the page afterwards with pointfair certify IN OUT";
  throw Error(ErrorKind::usage, text);
}

std::string size_text(std::uint64_t bytes) {
  return bytes < 1'000'000'000 ? fmt::format("{:.0f} MB", double(bytes) * 1e-6)
                               : fmt::format("{:.1f} GB", double(bytes) * 1e-9);
}

// Why a cloud is computed in tiles, where nobody asked for them.
std::string note_of(const TiledJob& job, const TiledChoice& choice) {
  if (job.inputs.size() > 1)
    return fmt::format("{} files are one cloud; --each treats every file on its own", job.inputs.size());
  if (choice.points == 0 || job.memory != 0) return {};
  return fmt::format(
      "{} points would take {} of memory, and {} are free: they are computed in tiles on disk, with the same result; "
      "--memory says how much memory to use",
      choice.points, size_text(choice.needed_bytes), size_text(choice.free_bytes));
}

// Before the work.
void check_outputs(const RunArguments& arguments, const TiledJob& job) {
  // --force does not help: a task reads an input when others may have written their outputs
  constexpr std::string_view kAdvice = "a run in tiles on disk replaces no input; name another output";
  if (job.output_folder.empty()) {
    check_not_same(arguments.input, arguments.output, kAdvice);
    check_report(arguments.report, {arguments.input, arguments.output});
    // where a run goes on, the output may be there: the plan knows
    if (!std::filesystem::exists(arguments.tiled.work)) check_paths(arguments);
    return;
  }
  std::vector<std::filesystem::path> clouds = job.inputs;
  for (const std::filesystem::path& input : job.inputs)
    clouds.push_back(job.output_folder / TiledRun::output_name(input));
  check_report(arguments.report, clouds);
  for (std::size_t i = 0; i < job.inputs.size(); ++i) {
    const std::filesystem::path& output = clouds[job.inputs.size() + i];
    check_not_same(job.inputs[i], output, kAdvice);
    check_writable(output, arguments.force || !arguments.tiled.work.empty());
  }
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

void check_no_format(const FormatArguments& format) {
  const std::string flag = !format.format.empty()     ? "--format " + format.format
                           : !format.encoding.empty() ? "--encoding " + format.encoding
                           : format.strict            ? "--strict"
                                                      : "";
  if (!flag.empty())
    throw Error(ErrorKind::usage, flag +
                                      ": the files of --out-dir are one cloud in tiles, each written in the format "
                                      "that it has; --each treats every file on its own");
}

Told run_in_tiles(const TiledJob& job, const fs::path& work, const Device& device, const TiledOutput& output,
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
    std::optional<Progress> own;
    Progress& progress = output.shown ? *output.shown : own.emplace(output.quiet ? "none" : output.progress);
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
  const DeviceInfo info = Pipeline(device).device();
  tell(report, info, output, &costs);
  Told told{.points = report.points,
            .outliers = report.unmoved.outliers + report.pulled.total(),
            .spacing = report.spacing,
            .noise = report.noise,
            .moved_mean = report.displacement.mean,
            .moved_max = report.displacement.max,
            .milliseconds = costs.milliseconds,
            .metres_per_unit = report.metres_per_unit,
            .notes = notes_of(report),
            .json = report_json(report, info, &costs)};
  if (!output.note.empty()) told.notes.insert(told.notes.begin(), output.note);
  return told;
}

void finish_tiles(const TiledRun& run, const Device& device, const TiledOutput& output) {
  tell(run.report(), Pipeline(device).device(), output, nullptr);
}

TiledJob make_tiled_job(const RunArguments& arguments, const Params& params, const Limits& limits,
                        const std::string& noise_attribute, const Device& device) {
  TiledJob job{.inputs = {arguments.input},
               .params = params,
               .limits = limits,
               .noise_attribute = noise_attribute,
               .viewpoint = arguments.viewpoint,
               .outlier_action = arguments.outlier_action};
  if (arguments.tiled.out_dir.empty()) {
    job.output = arguments.output;
    job.write = make_write_options(arguments.format, arguments.output);
  } else {
    check_no_format(arguments.format);
    job.inputs = files_of_survey(arguments.inputs());
    job.output_folder = arguments.tiled.out_dir;
  }
  job.write.las_scale = arguments.las_scale;
  job.write.overwrite = arguments.force;
  job.memory = memory_to_use(arguments.tiled);
  job.least_tiles = arguments.tiled.tiles;
  job.workers = static_cast<unsigned>(std::max<std::size_t>(1, device.cards.size()));
  return job;
}

TiledChoice choose(const RunArguments& arguments, const TiledJob& job, const Device& device) {
  const std::string flag = flag_for_memory(arguments);
  const TiledChoice choice = [&] {
    try {
      return TiledRun::choose(job, arguments.tiled.work, device);
    } catch (const Error& error) {  // of a file that cannot be read without what is said of it
      const bool may_be_read = error.kind() == ErrorKind::file && arguments.in.any() && fs::exists(arguments.input);
      if (!may_be_read) throw;
      if (job.memory != 0) refuse("--in-format, --columns and --skip", false);
      return TiledChoice{};
    }
  }();
  if (!choice.in_tiles || flag.empty()) return choice;
  const bool is_asked = choice.points == 0 || job.memory != 0;
  if (is_asked) refuse(flag, !job.output_folder.empty());
  return {};
}

Told run_tiled(const RunArguments& arguments, const TiledJob& job, const TiledChoice& choice, const Device& device,
               Progress* shown, std::stop_token stop) {
  std::optional<ResultFolder> folder;
  if (!job.output_folder.empty()) folder.emplace(job.output_folder);
  check_outputs(arguments, job);
  return run_in_tiles(
      job, arguments.tiled.work, device,
      {arguments.report, arguments.progress, arguments.quiet, arguments.verbose, note_of(job, choice), shown}, stop);
}

}  // namespace pointfair::cli
