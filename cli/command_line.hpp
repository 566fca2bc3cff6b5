// SPDX-License-Identifier: Apache-2.0
// The command that this program was started with, for what it writes about its work.
#pragma once

#include <string>
#include <vector>

namespace pointfair::cli {

/// Once, before any verb.
void remember_command(const std::vector<std::string>& words);

/// As a POSIX shell takes it: "pointfair run 'my scan.ply' out.ply".
const std::string& command_text();

}  // namespace pointfair::cli
