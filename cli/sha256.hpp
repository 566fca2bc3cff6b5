// SPDX-License-Identifier: Apache-2.0
// Checksums of files, as `sha256sum` prints them.
#pragma once

#include <filesystem>
#include <string>

namespace pointfair::cli {

/// 64 hexadecimal digits. Throws ErrorKind::file if the file cannot be read.
std::string sha256_of(const std::filesystem::path& path);

}  // namespace pointfair::cli
