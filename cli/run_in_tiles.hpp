// SPDX-License-Identifier: Apache-2.0
// A run in tiles on disk.
#pragma once

#include <stop_token>
#include <string>

#include "run_arguments.hpp"

namespace pointfair::cli {

/// What is asked for, as a run in tiles takes it.
TiledJob make_tiled_job(const RunArguments& arguments, const Params& params, const Limits& limits,
                        const std::string& noise_attribute, const Device& device);

/// Whether the job runs in tiles, as TiledRun::choose says. Throws ErrorKind::usage if it must, but a flag needs
/// memory.
TiledChoice choose(const RunArguments& arguments, const TiledJob& job, const Device& device);

void run_tiled(const RunArguments& arguments, const TiledJob& job, const TiledChoice& choice, const Device& device,
               std::stop_token stop);

}  // namespace pointfair::cli
