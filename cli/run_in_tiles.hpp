// SPDX-License-Identifier: Apache-2.0
// When a run is done in tiles on disk, and that run.
#pragma once

#include <stop_token>
#include <string>

#include "run_arguments.hpp"

namespace pointfair::cli {

/// Whether tiles on disk were asked for, or are needed to keep to --memory.
bool needs_tiles(const RunArguments& arguments, const Params& params);

/// Why a cloud is computed in tiles on disk though nobody asked for it: in memory it would take more than half of what
/// is free. Empty if it would not.
std::string why_tiles(const RunArguments& arguments, const Params& params, const Device& device);

/// `note`: why, where nobody asked for tiles.
void run_tiled(const RunArguments& arguments, const Params& params, const Limits& limits,
               const std::string& noise_attribute, const std::string& note, std::stop_token stop);

/// Runs in tiles if `why` names a reason and tiles can do what is asked for. Returns whether it ran: if not, the run in
/// memory may suffice.
bool is_run_tiled(const RunArguments& arguments, const Params& params, const Limits& limits,
                  const std::string& noise_attribute, const std::string& why, std::stop_token stop);

}  // namespace pointfair::cli
