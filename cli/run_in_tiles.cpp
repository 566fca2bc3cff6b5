// SPDX-License-Identifier: Apache-2.0
#include "run_in_tiles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "report.hpp"
#include "survey.hpp"

namespace pointfair::cli {
namespace {

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
    const FormatArguments& format = arguments.format;
    const std::string flag = !format.format.empty()     ? "--format " + format.format
                             : !format.encoding.empty() ? "--encoding " + format.encoding
                             : format.strict            ? "--strict"
                                                        : "";
    if (!flag.empty())
      throw Error(ErrorKind::usage, flag +
                                        ": the files of --out-dir are one cloud in tiles, each written in the format "
                                        "that it has; --each treats every file on its own");
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
  const TiledChoice choice = TiledRun::choose(job, arguments.tiled.work, device);
  const std::string flag = flag_for_memory(arguments);
  if (!choice.in_tiles || flag.empty()) return choice;
  const bool is_asked = choice.points == 0 || job.memory != 0;
  if (is_asked) refuse(flag, !job.output_folder.empty());
  return {};
}

void run_tiled(const RunArguments& arguments, const TiledJob& job, const TiledChoice& choice, const Device& device,
               std::stop_token stop) {
  std::optional<ResultFolder> folder;
  if (!job.output_folder.empty()) folder.emplace(job.output_folder);
  check_outputs(arguments, job);
  run_in_tiles(job, arguments.tiled.work, device,
               {arguments.report, arguments.progress, arguments.quiet, arguments.verbose, note_of(job, choice)}, stop);
}

}  // namespace pointfair::cli
