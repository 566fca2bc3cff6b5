// SPDX-License-Identifier: Apache-2.0
// The step of each iteration: the points of one tile, computed from them and what lies around them.
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include "pipeline/stage_settings.hpp"
#include "scale/plan.hpp"
#include "scale/stored_cloud.hpp"
#include "seam/backend.hpp"
#include "tiles/halo.hpp"

namespace pointfair::scale {

/// What the counts of a tile's file are.
inline constexpr std::size_t kTooFewCount = 1, kNoNormalCount = 2, kShortCount = 3;

struct TileWork {
  const StoredCloud& input;
  LeafRange leaves;
  TileStages stages;
  std::uint64_t most_points = 0;                    ///< that are loaded at once
  const std::vector<InputChunk>* chunks = nullptr;  ///< if given, results are written by chunk, for the last step
};

/// Writes where the tile's points are after the iteration; those that have no place any more are left out. Throws
/// Error(memory) if what a point needs does not fit.
void denoise(const TileWork& work, Backend& backend, const std::filesystem::path& path, const std::stop_token& stop);

}  // namespace pointfair::scale
