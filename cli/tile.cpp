// SPDX-License-Identifier: Apache-2.0
// pointfair tile plan|run|status|merge: a run over a folder, in tasks that any number of processes may do.
#include <fmt/format.h>

#include <charconv>
#include <memory>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "outlier_action.hpp"
#include "output.hpp"
#include "platform/system.hpp"
#include "point_noise.hpp"
#include "pointfair/pointfair.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "survey.hpp"
#include "tiled.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct TileArguments {
  std::vector<std::string> inputs;
  std::string output, folder, task, report, progress = "auto", viewpoint;
  std::optional<double> las_scale;
  TiledArguments tiled;
  ParamArguments params;
  LimitArguments limits;
  DeviceArguments device;
  FormatArguments format;
  bool all = false, force = false, quiet = false;
  int parent = 0;
};
using Shared = std::shared_ptr<TileArguments>;

void plan(TileArguments arguments) {
  TiledJob job;
  job.noise_attribute = take_noise_attribute(arguments.params);
  job.outlier_action = take_outlier_action(arguments.params);
  job.limits = make_limits(arguments.limits);
  job.viewpoint = arguments.viewpoint;
  job.inputs = files_of_survey(arguments.inputs);
  if (!arguments.output.empty()) {
    job.output = arguments.output;
    job.write = make_write_options(arguments.format, arguments.output);
  }
  job.output_folder = arguments.tiled.out_dir;
  if (!job.output_folder.empty()) check_no_format(arguments.format);
  job.write.las_scale = arguments.las_scale;
  job.write.overwrite = arguments.force;
  job.params = make_params(arguments.params, {});
  job.memory = memory_to_use(arguments.tiled);
  job.least_tiles = arguments.tiled.tiles;
  TiledRun::plan(job, arguments.tiled.work, arguments.device.threads);
}

// "denoise-1:3", or "denoise-1" for all its tasks.
void run_task(TiledRun& run, const std::string& name, std::stop_token stop) {
  const std::size_t colon = name.find(':');
  const std::string step = name.substr(0, colon);
  if (colon == std::string::npos) {
    for (const TiledRun::Step& its : run.steps()) {
      if (its.name != step) continue;
      for (std::size_t task = 0; task < its.tasks; ++task) run.run(step, task, stop);
      return;
    }
    return run.run(step, 0, stop);  // says that there is no such step
  }
  std::size_t task = 0;
  const char* const end = name.data() + name.size();
  const auto [read, error] = std::from_chars(name.data() + colon + 1, end, task);
  if (error != std::errc() || read != end)
    throw Error(ErrorKind::usage, fmt::format("--task {}: write it as STEP:NUMBER, denoise-1:3 for instance", name));
  run.run(step, task, stop);
}

void run_tasks(const TileArguments& arguments, std::stop_token stop) {
  // a worker of an engine that is killed must not leave its task running
  if (arguments.parent > 0 && !system::end_with_parent(arguments.parent))
    throw Error(ErrorKind::interrupted, "interrupted");
  system::keep_no_freed_memory();
  if (arguments.all == !arguments.task.empty()) throw Error(ErrorKind::usage, "give either --task or --all");
  TiledRun run(arguments.folder, make_device(arguments.device));
  if (!arguments.all) return run_task(run, arguments.task, stop);
  Progress progress(arguments.quiet ? "none" : arguments.progress);
  run.run_all(stop, [&](double share, std::string_view stage) { progress.show(share, stage); });
}

void status(const TileArguments& arguments) {
  check_report(arguments.report, {});
  const TiledRun run(arguments.folder);
  Json steps = Json::array();
  std::string text;
  for (const TiledRun::Step& step : run.steps()) {
    steps.push_back({{"step", step.name}, {"tasks", step.tasks}, {"done", step.done}});
    text += fmt::format("{:<12} {} of {} tasks done\n", step.name, step.done, step.tasks);
  }
  arguments.report.empty() ? print_output(text) : write_report(arguments.report, {{"steps", steps}});
}

void merge(const TileArguments& arguments, std::stop_token stop) {
  check_report(arguments.report, {});
  system::keep_no_freed_memory();
  TiledRun run(arguments.folder, make_device(arguments.device));
  run_task(run, "emit", stop);
  finish_tiles(run, make_device(arguments.device), {arguments.report, "none", arguments.quiet});
}

CLI::App& add_part(CLI::App& tile, const Shared& arguments, const char* name, const char* does) {
  CLI::App& part = *tile.add_subcommand(name, does);
  if (std::string_view(name) != "plan")
    part.add_option("DIR", arguments->folder, "the work folder of the plan")->required();
  return part;
}

void add_plan(CLI::App& tile, const Shared& arguments) {
  CLI::App& part = add_part(tile, arguments, "plan", "Fix inputs, parameters and tiles in a work folder.");
  part.add_option("IN", arguments->inputs,
                  "clouds to read, folders of such, or VPCs; all inputs together are one cloud")
      ->required();
  part.add_option("--out", arguments->output, "cloud to write, if there is one input")->type_name("OUT");
  part.add_option("--out-dir", arguments->tiled.out_dir, "write each input there under its name")
      ->check(name_of_folder())
      ->type_name("DIR");
  part.add_option("--work", arguments->tiled.work, "the work folder")->type_name("DIR")->required();
  part.add_option("--memory", arguments->tiled.memory,
                  "memory that a task may use, as 8G; default: half of the free memory")
      ->type_name("SIZE");
  part.add_option("--tiles", arguments->tiled.tiles, "at least N tiles")->check(whole_number_from(0))->type_name("N");
  add_params(part, arguments->params);
  add_limits(part, arguments->limits);
  add_viewpoint(part, arguments->viewpoint);
  add_threads(part, arguments->device.threads);
  add_format(part, arguments->format);
  part.add_option("--las-scale", arguments->las_scale, "finer step for the coordinates of LAS and LAZ")
      ->type_name("STEP");
  part.add_flag("--force", arguments->force, "replace outputs that exist");
}

}  // namespace

Verb add_tile(CLI::App& app) {
  const auto arguments = std::make_shared<TileArguments>();
  CLI::App& tile = *app.add_subcommand("tile", "Denoise clouds larger than memory, task by task.");
  tile.require_subcommand(1);
  add_plan(tile, arguments);
  CLI::App& run = add_part(tile, arguments, "run", "Do one task, one step's tasks, or all that is left.");
  run.add_option("--task", arguments->task, "one task, as denoise-1:3, or all tasks of a step, as denoise-1")
      ->type_name("TASK");
  run.add_flag("--all", arguments->all, "all tasks, in order");
  run.add_option("--end-with-parent", arguments->parent, "end when process PID ends, which must have started this one")
      ->type_name("PID");
  add_device(run, arguments->device);
  add_choice(run, "--progress", arguments->progress, {std::begin(kProgressModes), std::end(kProgressModes)},
             "progress on standard error; auto: a bar on a terminal");
  run.add_flag("-q,--quiet", arguments->quiet, "print errors only");
  CLI::App& state = add_part(tile, arguments, "status", "Say which tasks are done.");
  add_report(state, arguments->report);
  CLI::App& merging = add_part(tile, arguments, "merge", "Write the outputs once all tiles are done.");
  add_device(merging, arguments->device);
  add_report(merging, arguments->report);
  merging.add_flag("-q,--quiet", arguments->quiet, "print errors only");
  return {&tile, [arguments, &tile](std::stop_token stop) {
            if (tile.got_subcommand("plan")) return plan(*arguments);
            if (tile.got_subcommand("run")) return run_tasks(*arguments, stop);
            if (tile.got_subcommand("status")) return status(*arguments);
            merge(*arguments, stop);
          }};
}

}  // namespace pointfair::cli
