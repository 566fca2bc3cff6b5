// SPDX-License-Identifier: Apache-2.0
// The step of each iteration: the points of one tile, computed from them and what lies around them.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>

#include "scale/plan.hpp"
#include "scale/stored_cloud.hpp"
#include "seam/backend.hpp"

namespace pointfair::scale {

struct TileWork {
  const StoredCloud& input;
  LeafRange leaves;                                 ///< of the tree
  std::filesystem::path path;                       ///< of the file with the points as they are after the iteration
  FramedSettings stages;                            ///< for offsets from the cloud's origin
  std::uint64_t most_points = 0;                    ///< that are loaded at once
  const std::vector<InputChunk>* chunks = nullptr;  ///< if given, results are written by chunk, for the last step
  std::optional<Counts> first_counts{};             ///< the tile's in the first iteration, if this is a further one
};

/// Does the tiles that next() gives, until it gives none: one is computed and written while the next one is read. So
/// who is killed has one tile to do again. Outliers become the NaN that tells the reason. Throws Error(memory) if what
/// a point needs does not fit.
void denoise_all(const std::function<std::optional<TileWork>()>& next, Backend& backend, const std::stop_token& stop);

}  // namespace pointfair::scale
