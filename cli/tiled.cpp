// SPDX-License-Identifier: Apache-2.0
#include "tiled.hpp"

#include <fmt/format.h>
#include <malloc.h>

#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>

#include "interrupts.hpp"
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

// `milliseconds`: unknown where other processes did tasks.
Json report_json(const TiledReport& report, const DeviceInfo& device, std::optional<double> milliseconds) {
  const Displacement& moved = report.displacement;
  return {{"version", version()},
          {"device", device_json(device)},
          {"points", report.points},
          {"params", params_json(report.params)},
          {"spacing", report.spacing ? Json(*report.spacing) : Json()},
          {"rounding", rounding_json(report.step)},
          {"float_step", report.float_step},
          {"noise",
           {{"before", report.noise ? Json(*report.noise) : Json()},
            {"quantiles", report.noise ? Json(report.noise_quantiles) : Json()},
            {"attribute", report.noise_attribute.empty() ? Json() : Json(report.noise_attribute)}}},
          {"unmoved",
           {{"non_finite", report.unmoved.non_finite},
            {"too_few_neighbors", report.unmoved.too_few_neighbors},
            {"no_normal", report.unmoved.no_normal},
            {"outliers", report.unmoved.outliers},
            {"ignored", report.ignored},
            {"held", report.held}}},
          {"outliers", outliers_json(report.unmoved.outliers_by_reason)},
          {"short_neighborhoods", report.short_neighborhoods},
          {"displacement", statistics_json({moved.mean, moved.rms, moved.p95, moved.max})},
          {"tiles", report.tiles},
          {"total_ms", milliseconds ? Json(*milliseconds) : Json()}};
}

void print_summary(const TiledReport& report) {
  const UnmovedCounts& u = report.unmoved;
  const std::uint64_t kept = u.non_finite + u.too_few_neighbors + u.no_normal + u.outliers + report.ignored;
  fmt::print(stderr, "{} points denoised in {} {}, {} kept as they were\n",
             count_denoised(report.points, kept, report.held), report.tiles, report.tiles == 1 ? "tile" : "tiles",
             kept);
  if (report.held > 0) fmt::print(stderr, "limits, such as --where and --box, held {} points in place\n", report.held);
  fmt::print(stderr, "{}{}",
             noise_and_moves(report.noise, report.noise_attribute, report.displacement.mean, report.displacement.max),
             rounding_text(report.step));
  const double noise = report.noise.value_or(0);
  for (const std::string& note : {nothing_selected(report.points, u.non_finite, report.ignored, report.held),
                                  coarse_steps(report.step, noise), coarse_floats(report.float_step, noise)})
    if (!note.empty()) fmt::print(stderr, "note: {}\n", note);
}

void tell(const TiledReport& report, const Device& device, const TiledOutput& output,
          std::optional<double> milliseconds) {
  if (!output.report.empty()) write_report(output.report, report_json(report, Pipeline(device).device(), milliseconds));
  if (!output.quiet) print_summary(report);
}

}  // namespace

std::uint64_t parse_bytes(const std::string& flag, const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  std::string unit(end, text.data() + text.size());
  if (!unit.empty() && unit.back() == 'B') unit.pop_back();
  const int shift = unit.empty() ? 0 : unit == "K" ? 10 : unit == "M" ? 20 : unit == "G" ? 30 : unit == "T" ? 40 : -1;
  if (error != std::errc() || shift < 0 || !(value > 0) || !(std::ldexp(value, shift) < 1e18))
    throw Error(ErrorKind::usage, fmt::format("{} {}: give a size such as 8G or 512M", flag, text));
  const auto bytes = static_cast<std::uint64_t>(std::ldexp(value, shift));
  if (bytes < kLeastMemory) throw Error(ErrorKind::usage, fmt::format("{} {}: at least 64M is needed", flag, text));
  return bytes;
}

std::uint64_t memory_to_use(const TiledArguments& arguments) {
  return arguments.memory.empty() ? 0 : parse_bytes("--memory", arguments.memory);
}

// Otherwise glibc keeps freed arrays of up to 32 MB, which those of a tile mostly are: twice the memory.
void keep_no_freed_memory() {
#ifdef __GLIBC__
  ::mallopt(M_MMAP_THRESHOLD, 1 << 20);
#endif
}

void run_in_tiles(const TiledJob& job, const fs::path& work, const Device& device, const TiledOutput& output,
                  std::stop_token stop) {
  const auto start = std::chrono::steady_clock::now();
  keep_no_freed_memory();
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
    if (!output.quiet && !output.note.empty()) fmt::print(stderr, "note: {}\n", output.note);
    TiledRun run(folder, device);
    run.run_all(stop, [&](double share, std::string_view stage) { progress.show(share, stage); });
    report = run.report();
  }
  const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
  tell(report, device, output, taken.count());
}

void finish_tiles(const TiledRun& run, const Device& device, const TiledOutput& output) {
  tell(run.report(), device, output, {});
}

}  // namespace pointfair::cli
