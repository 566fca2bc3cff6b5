// SPDX-License-Identifier: Apache-2.0
// Runs in tiles on disk, for clouds that are larger than memory: what `run --memory` and `tile` share.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "arguments.hpp"
#include "pointfair/tiled_run.hpp"
#include "run_report.hpp"

namespace pointfair::cli {

struct RunArguments;
class Progress;

/// The flags that say how large a task may be and where its files are.
struct TiledArguments {
  std::string memory, out_dir, work;
  std::uint64_t tiles = 1;
};

/// The bytes that --memory gives, as 2G, 512M or a number; 0 where it is not given. Throws ErrorKind::usage.
std::uint64_t memory_to_use(const TiledArguments& arguments);

/// What else `run` was asked for beside a job: quiet, report and progress as there.
struct TiledOutput {
  std::string report, progress;
  bool quiet = false, verbose = false;
  std::string note{};         // that is printed once the run is planned
  Progress* shown = nullptr;  // where progress goes; null: to one of its own
};

/// Throws ErrorKind::usage for flags that say how one output is written, where there is a folder of them.
void check_no_format(const FormatArguments& format);

/// Does the whole job. Without a work folder, one beside the output that is removed whatever happens.
Told run_in_tiles(const TiledJob& job, const std::filesystem::path& work, const Device& device,
                  const TiledOutput& output, std::stop_token stop);

/// Says what a finished run did.
void finish_tiles(const TiledRun& run, const Device& device, const TiledOutput& output);

/// What is asked for, as a run in tiles takes it.
TiledJob make_tiled_job(const RunArguments& arguments, const Params& params, const Limits& limits,
                        const std::string& noise_attribute, const Device& device);

/// Whether the job runs in tiles, as TiledRun::choose says. Throws ErrorKind::usage if it must, but a flag needs
/// memory.
TiledChoice choose(const RunArguments& arguments, const TiledJob& job, const Device& device);

/// Does the job, and says what it did unless the flags are quiet. `shown`: as in TiledOutput.
Told run_tiled(const RunArguments& arguments, const TiledJob& job, const TiledChoice& choice, const Device& device,
               Progress* shown, std::stop_token stop);

}  // namespace pointfair::cli
