// SPDX-License-Identifier: Apache-2.0
// pointfair run IN OUT: denoise a cloud.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <vector>

#include "arguments.hpp"
#include "output.hpp"
#include "point_noise.hpp"
#include "pointfair/pointfair.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "run_report.hpp"
#include "survey.hpp"
#include "tiled.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct RunArguments {
  std::string input, output, report, progress = "auto", normals = "keep", write_noise, viewpoint, weights;
  std::vector<std::string> more;  // inputs, with an output folder
  TiledArguments tiled;
  std::optional<double> las_scale;
  ParamArguments params;
  LimitArguments limits;
  DeviceArguments device;
  InputArguments in;
  FormatArguments format;
  bool force = false, quiet = false, verbose = false, orient = false;
};

void check_paths(const RunArguments& arguments) {
  if (arguments.report == "-" && arguments.output == "-") {
    throw Error(ErrorKind::usage, "the cloud and the report cannot both go to standard output; give --report a file");
  }
  if (!arguments.force) {
    check_not_same(arguments.input, arguments.output, "name another output, or add --force to replace the input");
  }
  make_read_options(arguments.in, 0);
  check_writable(arguments.output, arguments.force);
  check_report(arguments.report, {arguments.input, arguments.output});
}

Cloud read_input(const RunArguments& arguments) {
  return read(arguments.input, make_read_options(arguments.in, arguments.device.threads));
}

// Refuses before the run what would fail after it.
void check_normals(const RunArguments& arguments, const Cloud& cloud, const WriteOptions& options) {
  if (arguments.normals != "keep") check_new_normals(cloud, options.format);
  if (arguments.normals == "update" && normal_attributes(cloud).empty())
    throw Error(ErrorKind::usage,
                fmt::format("--normals update: {} has no normals; --normals write adds them", arguments.input));
}

void check_orient(const RunArguments& arguments) {
  if (arguments.orient && arguments.normals == "keep")
    throw Error(ErrorKind::usage, "--orient is for new normals; add --normals write, or update");
}

// The normals of the last iteration. Where the file has its own, points that were not to move keep theirs.
void give_normals(Pipeline& pipeline, bool orient, std::span<const std::uint8_t> movable,
                  std::span<const Position> viewpoints, std::stop_token stop, Cloud& cloud) {
  std::vector<Point> normals(cloud.points.size());
  pipeline.normals(normals, stop);
  if (orient) orient_normals(cloud, normals, viewpoints, stop);
  const bool has_own = !normal_attributes(cloud).empty();
  for (std::size_t i = 0; has_own && i < movable.size(); ++i) {
    if (!movable[i]) normals[i] = {0, 0, 0};
  }
  set_normals(cloud, normals, viewpoints, orient ? NormalSigns::as_given : NormalSigns::by_rules);
}

WriteOptions write_options_of(const RunArguments& arguments) {
  WriteOptions options = make_write_options(arguments.format, arguments.output);
  options.las_scale = arguments.las_scale;
  options.overwrite = arguments.force;
  options.threads = arguments.device.threads;
  return options;
}

// Whether the cloud is to be computed in tiles on disk.
bool needs_tiles(const RunArguments& arguments, const Params& params) {
  const TiledArguments& tiled = arguments.tiled;
  if (!tiled.out_dir.empty() || !tiled.work.empty() || tiled.tiles > 1) return true;
  if (tiled.memory.empty()) return false;
  if (arguments.input == "-")
    throw Error(ErrorKind::usage, "standard input is read into memory as a whole; leave out --memory, or name a file");
  return TiledRun::bytes_in_memory(TiledRun::count_points(arguments.input), params) > memory_to_use(tiled);
}

// What a run in tiles leaves out where nobody asked for tiles.
std::string_view but_without_sensors(const RunArguments& arguments) {
  const std::optional<Format> format = format_of(arguments.input);
  const bool may_know_sensors = (format == Format::e57 || format == Format::ptx) && arguments.viewpoint.empty();
  return may_know_sensors ? ", but mixed pixels are not looked for if its scans were made from several places" : "";
}

// Why a cloud is computed in tiles on disk though nobody asked for it: in memory it would take more than half of what
// is free. Empty if it would not.
std::string why_tiles(const RunArguments& arguments, const Params& params, const Device& device) {
  if (!arguments.tiled.memory.empty() || arguments.input == "-" || arguments.output == "-") return {};
  if (arguments.normals != "keep" || !arguments.write_noise.empty() || arguments.in.any())
    return {};                                                         // not in tiles yet
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

// Why a cloud that fits into memory is computed in tiles on disk: it is so wide that it needs zones. Empty if it does
// not, or if tiles cannot do what is asked for.
std::string why_zones(const RunArguments& arguments, const Cloud& cloud) {
  if (arguments.input == "-" || arguments.output == "-") return {};
  if (arguments.normals != "keep" || !arguments.write_noise.empty() || arguments.in.any()) return {};
  const double step = TiledRun::float_step_in_zones(cloud);
  if (!(step > 0)) return {};
  try {
    TiledRun::count_points(arguments.input);
  } catch (const Error&) {
    return {};  // it can only be decoded as a whole
  }
  return fmt::format(
      "floats around one origin are too coarse for a cloud as wide and dense as this one: it is computed in tiles on "
      "disk, in zones where floats step by {:.4g}{}",
      step, but_without_sensors(arguments));
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

// What runs in tiles cannot do yet.
void check_tiled(const RunArguments& arguments) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorKind::usage, what + " cannot be used with a run in tiles on disk (--memory, --work, --out-dir)");
  };
  if (arguments.normals != "keep") refuse("--normals " + arguments.normals);
  if (!arguments.write_noise.empty()) refuse("--write-noise");
  if (!arguments.weights.empty()) refuse("--weights");
  if (arguments.in.any()) refuse("--in-format, --columns and --skip");
}

// `note`: why, where nobody asked for tiles.
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
  run_in_tiles(job, arguments.tiled.work, device, {arguments.report, arguments.progress, arguments.quiet, note}, stop);
}

// Where nothing is to move, degrees do no harm: the pipeline is not told the file then, since it would refuse.
void load(const Limits& limits, const Cloud& cloud, Pipeline& pipeline) {
  if (limits.strength > 0) check_not_geographic(cloud);
  if (file_info(cloud).is_geographic) {
    Cloud without_file = without_ignored(limits, cloud);
    without_file.source.reset();
    return pipeline.load(without_file);
  }
  if (limits.ignore.empty()) return pipeline.load(cloud);
  pipeline.load(without_ignored(limits, cloud));
}

void run_in_memory(const RunArguments& arguments, const Params& params, const Limits& limits, const Cloud& cloud,
                   const WriteOptions& write_options, Pipeline& pipeline, Progress& progress, Findings& findings,
                   std::stop_token stop) {
  check_normals(arguments, cloud, write_options);
  check_write(arguments.output, cloud, write_options);
  if (!arguments.write_noise.empty()) check_noise_attribute(cloud, arguments.write_noise, write_options);
  const std::vector<std::uint8_t> movable = movable_points(limits, cloud);
  load(limits, cloud, pipeline);
  if (!findings.noise_attribute.empty())
    use_noise_attribute(cloud, findings.noise_attribute, arguments.input, pipeline);
  std::vector<Position> viewpoints;  // where another was given than the file's
  if (!arguments.viewpoint.empty()) pipeline.set_viewpoint(viewpoints = parse_viewpoints(arguments.viewpoint, cloud));
  Cloud denoised =
      pipeline.run(params, stop, [&](double share, std::string_view stage) { progress.show(share, stage); });
  denoised.source = cloud.source;
  apply_limits(limits, movable, cloud.points, denoised.points);
  if (arguments.normals != "keep") give_normals(pipeline, arguments.orient, movable, viewpoints, stop, denoised);
  if (!arguments.write_noise.empty()) write_noise_attribute(pipeline, params, arguments.write_noise, stop, denoised);
  progress.show(1, "writing");
  write(arguments.output, denoised, write_options);
  if (!arguments.quiet || !arguments.report.empty()) {
    progress.show(1, "measuring");
    count_limited(cloud, limits, movable, findings);
    find_out(arguments.normals == "keep", write_options, cloud, denoised, pipeline, stop, findings);
  }
}

// Whether it was; not where tiles cannot do what is asked for, in which case memory may suffice.
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

void run(RunArguments arguments, std::stop_token stop) {
  Findings findings;
  findings.noise_attribute = take_noise_attribute(arguments.params);
  const Params params = make_params(arguments.params, {});
  const Limits limits = make_limits(arguments.limits);
  const Device device = make_device(arguments.device);
  check_viewpoint(arguments.viewpoint);
  check_orient(arguments);
  if (arguments.tiled.out_dir.empty() && !arguments.more.empty())
    throw Error(ErrorKind::usage, "several inputs need a folder for their results; give --out-dir");
  if (arguments.tiled.out_dir.empty() && is_survey(arguments.input))
    throw Error(ErrorKind::file, arguments.input + ": is a survey of several files; give --out-dir for their results");
  if (arguments.tiled.out_dir.empty() && arguments.output.empty())
    throw Error(ErrorKind::usage, "OUT is required; see pointfair run --help");
  if (needs_tiles(arguments, params)) return run_tiled(arguments, params, limits, findings.noise_attribute, {}, stop);
  const auto takes_tiles = [&](const std::string& why) {
    return is_run_tiled(arguments, params, limits, findings.noise_attribute, why, stop);
  };
  if (takes_tiles(why_tiles(arguments, params, device))) return;
  check_paths(arguments);
  const WriteOptions write_options = write_options_of(arguments);
  Pipeline pipeline(device);
  if (!arguments.weights.empty()) pipeline.set_weights(weights_of(arguments.weights), arguments.weights);
  {
    const char* const mode = arguments.quiet ? "none" : arguments.progress.c_str();
    std::optional<Progress> progress(mode);
    progress->show(0, "reading");
    std::optional<Cloud> cloud = read_input(arguments);
    if (const std::string why = why_zones(arguments, *cloud); !why.empty()) {
      progress.reset();
      cloud.reset();
      if (takes_tiles(why)) return;
      progress.emplace(mode);
      cloud = read_input(arguments);
    }
    run_in_memory(arguments, params, limits, *cloud, write_options, pipeline, *progress, findings, stop);
  }
  write_report(arguments.report, run_json(pipeline.report(), findings));
  if (!arguments.quiet) print_summary(pipeline.report(), findings, arguments.verbose);
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
                     "more inputs: with --out-dir, OUT is an input too, and all inputs together are one cloud");
  add_params(command, arguments->params);
  add_limits(command, arguments->limits);
  add_viewpoint(command, arguments->viewpoint);
  add_device(command, arguments->device);
  add_input(command, arguments->in);
  add_format(command, arguments->format);
  command
      .add_option(
          "--las-scale", arguments->las_scale,
          "finer step for the coordinates of LAS and LAZ: the input's divided by a whole number, as 0.001 for 0.01")
      ->type_name("STEP");
  add_choice(command, "--normals", arguments->normals, {"keep", "update", "write"},
             "keep: those in the file stay; update: new ones replace them; write: also where the file has none");
  command.add_flag("--orient", arguments->orient,
                   "new normals look to one side: to the sensor where its place is known, else out of closed shapes");
  command
      .add_flag("--write-noise{noise}", arguments->write_noise,
                "add the standard deviation of the noise at each point, as an attribute of this name; default: noise")
      ->type_name("[=NAME]")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  command.add_option("--weights", arguments->weights, "with --method learned: a file of weights in place of its own")
      ->type_name("FILE");
  command
      .add_option(
          "--memory", arguments->tiled.memory,
          "use no more than this, as 8G; a cloud that does not fit is computed in tiles on disk, with the same bits")
      ->type_name("SIZE");
  command.add_option("--out-dir", arguments->tiled.out_dir, "write each input there under its name")->type_name("DIR");
  command
      .add_option(
          "--work", arguments->tiled.work,
          "keep the intermediate files of a run in tiles there; after a stop, the same command goes on from them")
      ->type_name("DIR");
  command.add_option("--tiles", arguments->tiled.tiles, "compute in at least N tiles on disk")->type_name("N");
  add_report(command, arguments->report);
  add_choice(command, "--progress", arguments->progress, {std::begin(kProgressModes), std::end(kProgressModes)},
             "progress on standard error; auto: a bar on a terminal");
  command.add_flag("--force", arguments->force, "replace OUT if it exists");
  command.add_flag("-q,--quiet", arguments->quiet, "print errors only");
  command.add_flag("-v,--verbose", arguments->verbose, "print the device, the parameters and each stage's time");
  return {&command, [arguments](std::stop_token stop) { run(*arguments, stop); }};
}

}  // namespace pointfair::cli
