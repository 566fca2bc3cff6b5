// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "pointfair/empty_files.hpp"

namespace pointfair::io {

/// Of a file whose header says so. A text without rows may be any other file and is refused as such.
[[noreturn]] inline void fail_without_points(const std::string& name) {
  throw NoPoints(name + ": has no points; choose another file");
}

/// Throws as copy_without_points() would for the format and the encoding that are asked for.
void check_copy_without_points(const std::filesystem::path& from, const std::filesystem::path& to,
                               const WriteOptions& options);

}  // namespace pointfair::io
