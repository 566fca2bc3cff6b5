// SPDX-License-Identifier: Apache-2.0
// Names of files and folders that are there only while a process works on them: they tell whose they are, so that those
// of a process that was killed can be found.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace pointfair::io {

/// What outputs are called until they are complete.
inline constexpr std::string_view kUnfinishedOutput = ".pointfair-";

/// PREFIX, this machine, this process, and a number that no other name of this process has.
std::string unfinished_name(std::string_view prefix);

/// Removes what has a name of unfinished_name(prefix) in the folder and is of a process of this machine that is no
/// more.
void remove_abandoned(const std::filesystem::path& folder, std::string_view prefix) noexcept;

}  // namespace pointfair::io
