// SPDX-License-Identifier: Apache-2.0
// What systems call differently about files.
#pragma once

#include <sys/stat.h>

#include <ctime>
#include <filesystem>

namespace pointfair::platform {

// When the file was last written.
std::timespec time_of_change(const struct stat& status);

// Gives a file another name, in one step, only if nothing has that name yet. 0, or -1 and errno as rename().
int rename_to_free_name(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace pointfair::platform
