// SPDX-License-Identifier: Apache-2.0
// The verbs of the command line, one file each. add_* describes a verb's arguments; its action does the work and
// throws what goes wrong.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <stop_token>

namespace pointfair::cli {

struct Verb {
  CLI::App* command;
  std::function<void(std::stop_token)> action;
};

Verb add_run(CLI::App& app);
Verb add_certify(CLI::App& app);
Verb add_tile(CLI::App& app);
Verb add_info(CLI::App& app);
Verb add_compare(CLI::App& app);
Verb add_noise(CLI::App& app);
Verb add_bench(CLI::App& app);
Verb add_doctor(CLI::App& app);
Verb add_view(CLI::App& app);

}  // namespace pointfair::cli
