// SPDX-License-Identifier: Apache-2.0
// Runs in tiles on disk, for clouds that are larger than memory: what `run --memory` and `tile` share.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "pointfair/tiled_run.hpp"

namespace pointfair::cli {

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
  std::string note{};  // that is printed once the run is planned
};

/// Does the whole job. Without a work folder, one beside the output that is removed whatever happens.
void run_in_tiles(const TiledJob& job, const std::filesystem::path& work, const Device& device,
                  const TiledOutput& output, std::stop_token stop);

/// Says what a finished run did.
void finish_tiles(const TiledRun& run, const Device& device, const TiledOutput& output);

}  // namespace pointfair::cli
