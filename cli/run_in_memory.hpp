// SPDX-License-Identifier: Apache-2.0
// A run of one cloud in memory.
#pragma once

#include <stop_token>

#include "progress.hpp"
#include "run_arguments.hpp"
#include "run_report.hpp"

namespace pointfair::cli {

Cloud read_input(const RunArguments& arguments);

/// Denoises the cloud of the input, writes the output and, if it is a page, the report. `findings` gets what is to say.
void run_in_memory(const RunArguments& arguments, const Params& params, const Limits& limits, const Cloud& cloud,
                   Pipeline& pipeline, Progress& progress, Findings& findings, std::stop_token stop);

}  // namespace pointfair::cli
