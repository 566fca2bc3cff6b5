// SPDX-License-Identifier: Apache-2.0
// For tests: a run over devices of one's own, which share its tiles as several cards do.
#pragma once

#include <filesystem>
#include <vector>

#include "pointfair/tiled_run.hpp"

namespace pointfair {

struct TiledRunAccess {
  static TiledRun make(const std::filesystem::path& work, const std::vector<Device>& workers);
};

}  // namespace pointfair
