// SPDX-License-Identifier: Apache-2.0
// pointfair run IN OUT: denoise a cloud.
#include <fmt/format.h>

#include <fstream>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "arguments.hpp"
#include "output.hpp"
#include "platform/system.hpp"
#include "point_noise.hpp"
#include "pointfair/pointfair.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "run_arguments.hpp"
#include "run_each.hpp"
#include "run_in_memory.hpp"
#include "run_report.hpp"
#include "survey.hpp"
#include "tiled.hpp"
#include "verbs.hpp"

namespace pointfair::cli {

void check_paths(const RunArguments& arguments) {
  if (arguments.report == "-" && arguments.output == "-")
    throw Error(ErrorKind::usage, "the cloud and the report cannot both go to standard output; give --report a file");
  if (!system::replaces_what_is_read()) {
    check_not_same(arguments.input, arguments.output,
                   "name another output: this system replaces no file that is being read");
  } else if (!arguments.force) {
    check_not_same(arguments.input, arguments.output, "name another output, or add --force to replace the input");
  }
  make_read_options(arguments.in, 0);
  check_writable(arguments.output, arguments.force);
  if (is_page(arguments.report) && (is_stream(arguments.input) || is_stream(arguments.output)))
    throw Error(ErrorKind::usage, "a page tells of two files; name both, or give --report a .json file");
  check_kind_of_report(arguments.report);
  check_page(arguments.report, {arguments.input, arguments.output});
}

namespace {

void check_orient(const RunArguments& arguments) {
  if (arguments.orient && arguments.normals == "keep")
    throw Error(ErrorKind::usage, "--orient is for new normals; add --normals write, or update");
}

// The bytes of a file of weights; one that is far too large is not read whole.
std::vector<std::byte> weights_of(const std::string& path) {
  constexpr std::streamsize kMost = 1 << 20;
  std::ifstream file(path, std::ios::binary);
  std::vector<std::byte> bytes(kMost);
  file.read(reinterpret_cast<char*>(bytes.data()), kMost);
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  if (bytes.empty()) throw Error(ErrorKind::file, path + ": this file of weights cannot be read, or is empty");
  return bytes;
}

// What is to say of the run; that of a run in tiles was said unless the flags are quiet. `shown`: where progress goes;
// null: to one of its own.
std::variant<Findings, Told> run_file(const RunArguments& arguments, Findings findings, const Limits& limits,
                                      const Device& device, Progress* shown, std::stop_token stop) {
  const TiledJob job = make_tiled_job(arguments, findings.asked, limits, findings.noise_attribute, device);
  if (const TiledChoice choice = choose(arguments, job, device); choice.in_tiles)
    return run_tiled(arguments, job, choice, device, shown, stop);
  check_paths(arguments);
  Pipeline pipeline(device);
  if (!arguments.weights.empty()) pipeline.set_weights(weights_of(arguments.weights), arguments.weights);
  std::optional<Progress> own;
  const auto progress = [&]() -> Progress& {
    if (shown) return *shown;
    if (!own) own.emplace(arguments.quiet ? "none" : arguments.progress.c_str());
    return *own;
  };
  progress().show(0, "reading");
  const Cloud cloud = read_input(arguments);
  run_in_memory(arguments, findings.asked, limits, cloud, pipeline, progress(), findings, stop);
  return findings;
}

// Refuses inputs and outputs that do not go together.
void check_files(const RunArguments& arguments) {
  if (!arguments.tiled.out_dir.empty()) return;
  if (!arguments.more.empty())
    throw Error(ErrorKind::usage,
                fmt::format("several inputs, the last of them {}, need a folder for their results; give --out-dir",
                            arguments.more.back()));
  if (is_survey(arguments.input))
    throw Error(ErrorKind::file, described_survey(arguments.input, arguments.in.format) +
                                     "; give --out-dir DIR for their results" +
                                     (arguments.each ? "" : ", and --each if they are not one cloud"));
  if (arguments.each || arguments.skip_existing)
    throw Error(ErrorKind::usage,
                "--each and --skip-existing are for many files; give --out-dir DIR for their results");
  if (arguments.output.empty()) throw Error(ErrorKind::usage, "OUT is required; see pointfair run --help");
}

void run(RunArguments arguments, std::stop_token stop) {
  Findings findings;
  findings.noise_attribute = take_noise_attribute(arguments.params);
  arguments.outlier_action = take_outlier_action(arguments.params);
  findings.asked = make_params(arguments.params, {});
  const Limits limits = make_limits(arguments.limits);
  const Device device = make_device(arguments.device);
  check_viewpoint(arguments.viewpoint);
  check_orient(arguments);
  check_files(arguments);
  if (arguments.each)
    return run_each(
        arguments,
        [&](const RunArguments& of_file, Progress& progress) {
          const auto found = run_file(of_file, findings, limits, device, &progress, stop);
          const auto* const in_memory = std::get_if<Findings>(&found);
          return in_memory ? told_of(*in_memory) : std::get<Told>(found);
        },
        stop);
  if (arguments.skip_existing) throw Error(ErrorKind::usage, "--skip-existing goes with --each");
  const auto ran = run_file(arguments, findings, limits, device, nullptr, stop);
  const auto* const found = std::get_if<Findings>(&ran);
  if (!found) return;
  if (!is_page(arguments.report)) write_report(arguments.report, run_json(found->report, *found));
  if (!arguments.quiet) print_summary(found->report, *found, arguments.verbose);
}

// A flag that takes a name after an equals sign only, since a cloud may follow it.
void add_named_flag(CLI::App& command, const std::string& flag, const std::string& name, std::string& value,
                    const std::string& help) {
  command.add_flag(flag, value, help + "; default: " + name)
      ->transform([name](const std::string& text) { return text == "true" ? name : text; })
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)
      ->group(kOutputGroup)
      ->type_name("[=NAME]");
}

}  // namespace

Verb add_run(CLI::App& app) {
  const auto arguments = std::make_shared<RunArguments>();
  CLI::App& command = *app.add_subcommand("run", "Denoise a cloud and keep its shape.");
  command
      .add_option("IN", arguments->input,
                  "cloud to read; - is standard input. With --out-dir also a folder of clouds, or a VPC")
      ->required();
  command.add_option("OUT", arguments->output, "cloud to write; - is standard output");
  command.add_option("MORE", arguments->more,
                     "more inputs: with --out-dir, OUT is an input too, and all inputs together are one cloud, or one "
                     "each with --each");
  add_params(command, arguments->params);
  command.get_option("--outliers")->type_name(fmt::format("off|move|keep|mark|{}|auto", kOutlierActions));
  add_limits(command, arguments->limits);
  add_viewpoint(command, arguments->viewpoint);
  add_device(command, arguments->device);
  add_input(command, arguments->in);
  add_format(command, arguments->format);
  command
      .add_option(
          "--las-scale", arguments->las_scale,
          "finer step for the coordinates of LAS and LAZ: the input's divided by a whole number, as 0.001 for 0.01")
      ->type_name("STEP")
      ->group(kOutputGroup);
  add_choice(command, "--normals", arguments->normals, {"keep", "update", "write"},
             "keep: those in the file stay; update: new ones replace them; write: also where the file has none")
      ->group(kOutputGroup);
  command
      .add_flag("--orient", arguments->orient,
                "new normals look to one side: to the sensor where its place is known, else out of closed shapes")
      ->group(kOutputGroup);
  add_named_flag(command, "--write-noise", "noise", arguments->write_noise,
                 "add the standard deviation of the noise at each point, as an attribute of this name");
  add_named_flag(command, "--write-displacement", "displacement", arguments->write_displacement,
                 "add how far each point moved, as an attribute of this name");
  command.add_option("--weights", arguments->weights, "with --method learned: a file of weights in place of its own")
      ->type_name("FILE")
      ->group(kExpertGroup);
  command
      .add_option(
          "--memory", arguments->tiled.memory,
          "use no more than this, as 8G; a cloud that does not fit is computed in tiles on disk, with the same bits")
      ->type_name("SIZE");
  command.add_option("--out-dir", arguments->tiled.out_dir, "write each input there under its name")
      ->check(name_of_folder())
      ->type_name("DIR");
  command.add_flag(
      "--each", arguments->each,
      "with --out-dir: every file is a cloud of its own; one that fails does not stop the others. --format gives "
      "the results its extension");
  command.add_flag("--skip-existing", arguments->skip_existing, "with --each: pass over files whose result is there")
      ->group(kMoreGroup);
  command
      .add_option(
          "--work", arguments->tiled.work,
          "keep the intermediate files of a run in tiles there; after a stop, the same command goes on from them")
      ->type_name("DIR")
      ->group(kMoreGroup);
  command.add_option("--tiles", arguments->tiled.tiles, "compute in at least N tiles on disk")
      ->check(whole_number_from(0))
      ->type_name("N")
      ->group(kMoreGroup);
  command
      .add_option("--report", arguments->report,
                  "write a report: JSON, or a page with pictures if the name ends in .html; - is standard output")
      ->type_name("FILE|-");
  add_choice(command, "--progress", arguments->progress, {std::begin(kProgressModes), std::end(kProgressModes)},
             "progress on standard error; auto: a bar on a terminal")
      ->group(kMoreGroup);
  command.add_flag("--force", arguments->force, "replace OUT if it exists");
  command.add_flag("-q,--quiet", arguments->quiet, "print errors only");
  command.add_flag("-v,--verbose", arguments->verbose, "print the device, the parameters and each stage's time")
      ->group(kMoreGroup);
  command.get_option("--threads")->group(kMoreGroup);
  return {&command, [arguments](std::stop_token stop) { run(*arguments, stop); }};
}

}  // namespace pointfair::cli
