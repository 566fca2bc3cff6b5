// SPDX-License-Identifier: Apache-2.0
// What is said of words that the command line does not understand.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace pointfair::cli {

/// "pointfair tile run" for instance.
std::string words_of(const CLI::App* command);

/// The innermost command that was named.
CLI::App& asked_command(CLI::App& app);

/// One sentence on the first word, which is the name of no verb; with a guess where one is near.
std::string unknown_verb(const std::string& word, const CLI::App& app);

/// One sentence on what CLI11 refused while it read the words of `app`.
std::string told(const CLI::ParseError& error, CLI::App& app);

}  // namespace pointfair::cli
