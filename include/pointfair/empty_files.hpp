// SPDX-License-Identifier: Apache-2.0
// Files that are sound and hold no points, such as tiles without a return.
#pragma once

#include <filesystem>
#include <string>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/io.hpp"

namespace pointfair {

/// What reading throws for a file whose header says that it holds no points. Its kind is ErrorKind::file.
class POINTFAIR_EXPORT NoPoints : public Error {
 public:
  explicit NoPoints(const std::string& message) : Error(ErrorKind::file, message) {}
};

/// Writes a file of which reading throws NoPoints again, byte for byte: `to` appears when it is complete. Of the
/// options, `overwrite` and `sync` count. O(bytes). Throws NoPoints where `to` or the options ask for another format or
/// for an encoding, and Error as write() does.
POINTFAIR_EXPORT void copy_without_points(const std::filesystem::path& from, const std::filesystem::path& to,
                                          const WriteOptions& options = {});

}  // namespace pointfair
