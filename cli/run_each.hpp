// SPDX-License-Identifier: Apache-2.0
// Many files, each on its own: run --each.
#pragma once

#include <functional>
#include <stop_token>

#include "progress.hpp"
#include "run_arguments.hpp"
#include "run_report.hpp"

namespace pointfair::cli {

/// Runs one file; what is to say of it.
using RunFile = std::function<Told(const RunArguments& of_file, Progress& progress)>;

/// Runs all files, and goes on after one that fails. Prints a row a file, the failures at the end, and writes the
/// report, CSV or JSON. Throws ErrorKind::usage before the first run, and at the end the kind of error that all
/// failures have in common, else ErrorKind::failed.
void run_each(const RunArguments& arguments, const RunFile& run_file, std::stop_token stop);

}  // namespace pointfair::cli
