// SPDX-License-Identifier: Apache-2.0
#include "run_in_tiles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "report.hpp"
#include "survey.hpp"

namespace pointfair::cli {
namespace {

// What a run in tiles leaves out where nobody asked for tiles.
std::string_view but_without_sensors(const RunArguments& arguments) {
  const std::optional<Format> format = format_of(arguments.input);
  const bool may_know_sensors = (format == Format::e57 || format == Format::ptx) && arguments.viewpoint.empty();
  return may_know_sensors ? ", but mixed pixels are not looked for if its scans were made from several places" : "";
}

// What runs in tiles cannot do yet.
void check_tiled(const RunArguments& arguments) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorKind::usage, what + " cannot be used with a run in tiles on disk (--memory, --work, --out-dir)");
  };
  if (arguments.normals != "keep") refuse("--normals " + arguments.normals);
  if (!arguments.write_noise.empty()) refuse("--write-noise");
  if (!arguments.write_displacement.empty()) refuse("--write-displacement");
  if (is_page(arguments.report))
    throw Error(ErrorKind::usage,
                fmt::format("--report {}: a run in tiles on disk writes JSON; make the page afterwards "
                            "with pointfair certify IN OUT",
                            arguments.report));
  if (arguments.outlier_action.kind != OutlierAction::Kind::none) refuse("--outliers classify, withheld and remove");
  if (!arguments.weights.empty()) refuse("--weights");
  if (arguments.in.any()) refuse("--in-format, --columns and --skip");
}

}  // namespace

bool needs_tiles(const RunArguments& arguments, const Params& params) {
  const TiledArguments& tiled = arguments.tiled;
  if (!tiled.out_dir.empty() || !tiled.work.empty() || tiled.tiles > 1) return true;
  if (tiled.memory.empty()) return false;
  if (arguments.input == "-")
    throw Error(ErrorKind::usage, "standard input is read into memory as a whole; leave out --memory, or name a file");
  return TiledRun::bytes_in_memory(TiledRun::count_points(arguments.input), params) > memory_to_use(tiled);
}

std::string why_tiles(const RunArguments& arguments, const Params& params, const Device& device) {
  if (!arguments.tiled.memory.empty() || arguments.input == "-" || arguments.output == "-") return {};
  if (needs_memory(arguments) || needs_cpu_and_memory(params)) return {};
  constexpr std::uint64_t kLeastBytesOfRecord = 2, kBytesOnCard = 64;  // of a point, in a file and beside a card
  std::error_code failed;
  const std::uint64_t size = std::filesystem::file_size(arguments.input, failed), free = TiledRun::free_memory();
  if (failed || TiledRun::bytes_in_memory(size / kLeastBytesOfRecord, params) <= free / 2) return {};
  const std::uint64_t points = TiledRun::count_points(arguments.input);
  std::uint64_t needed = TiledRun::bytes_in_memory(points, params);
  if (needed > free / 2 && Pipeline(device).device().kind == Device::cuda) needed = points * kBytesOnCard;
  if (needed <= free / 2) return {};
  return fmt::format(
      "{} points would take {:.1f} GB of memory, and {:.1f} GB are free: they are computed in tiles on disk, with the "
      "same result{}; --memory says how much memory to use",
      points, double(needed) * 1e-9, double(free) * 1e-9, but_without_sensors(arguments));
}

void run_tiled(const RunArguments& arguments, const Params& params, const Limits& limits,
               const std::string& noise_attribute, const std::string& note, std::stop_token stop) {
  check_tiled(arguments);
  const Device device = make_device(arguments.device);
  TiledJob job;
  job.limits = limits;
  job.noise_attribute = noise_attribute;
  job.viewpoint = arguments.viewpoint;
  job.workers = static_cast<unsigned>(std::max<std::size_t>(1, device.cards.size()));
  if (arguments.tiled.out_dir.empty()) {
    job.inputs = {arguments.input};
    // where a run goes on, the output may be there: the plan knows
    if (!std::filesystem::exists(arguments.tiled.work)) check_paths(arguments);
    job.output = arguments.output;
    job.write = make_write_options(arguments.format, arguments.output);
  } else {
    std::vector<std::string> inputs = {arguments.input};
    if (!arguments.output.empty()) inputs.push_back(arguments.output);
    inputs.insert(inputs.end(), arguments.more.begin(), arguments.more.end());
    job.inputs = files_of_survey(inputs);
    job.output_folder = arguments.tiled.out_dir;
    std::error_code failed;
    std::filesystem::create_directories(job.output_folder, failed);
    if (failed)
      throw Error(ErrorKind::file, job.output_folder.string() + ": this folder cannot be made: " + failed.message());
    for (const std::filesystem::path& input : job.inputs) {
      check_writable(job.output_folder / TiledRun::output_name(input),
                     arguments.force || !arguments.tiled.work.empty());
    }
    check_report(arguments.report, {});
  }
  job.write.las_scale = arguments.las_scale;
  job.write.overwrite = arguments.force;
  job.params = params;
  job.memory = memory_to_use(arguments.tiled);
  job.least_tiles = arguments.tiled.tiles;
  std::string said = note;
  if (job.inputs.size() > 1)
    said = fmt::format("{} files are one cloud; --each treats every file on its own", job.inputs.size());
  run_in_tiles(job, arguments.tiled.work, device, {arguments.report, arguments.progress, arguments.quiet, said}, stop);
}

bool is_run_tiled(const RunArguments& arguments, const Params& params, const Limits& limits,
                  const std::string& noise_attribute, const std::string& why, std::stop_token stop) {
  if (why.empty()) return false;
  try {
    run_tiled(arguments, params, limits, noise_attribute, why, stop);
    return true;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::usage) throw;
    return false;
  }
}

}  // namespace pointfair::cli
