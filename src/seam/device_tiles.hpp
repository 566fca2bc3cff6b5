// SPDX-License-Identifier: Apache-2.0
// Tiles of a cloud that lies in the memory of a device. This device or others of the same kind compute them: each
// tile's points are copied from device to device, and so are its results.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "point/region.h"
#include "seam/backend.hpp"
#include "seam/sampling.hpp"

namespace pointfair {

// The points of a cell are wanted, all in the region are loaded.
struct DeviceTile {
  point::Cell cell;
  point::Region loaded;
};

// What a tile gave.
struct TileTally {
  Counts counts;  // of the points whose results were taken
  Bounds left;    // of those of its cell that have no exact result yet; 0 of them: `left.min` and `max` mean nothing
};

class DeviceTiles {
 public:
  virtual ~DeviceTiles() = default;
  static constexpr std::size_t kMostTiles = 16;  // that are gathered at once

  // Calls to the device that holds the cloud, by one thread. They leave its index and stages alone, but for the faired
  // points of the iteration.

  // Of this iteration are the input of all tiles from now on, and their results, of which none is there yet. Invalid
  // points are not waited for.
  virtual void begin_tiles(int iteration) = 0;
  // Gathers the valid points of up to kMostTiles regions, and returns how many they are.
  virtual std::vector<std::size_t> gather(std::span<const DeviceTile> tiles) = 0;
  // Which points they are, in the order in which take() gives them to the device of that tile.
  virtual std::vector<std::uint32_t> gathered(std::size_t tile) = 0;
  // Takes what all gathered tiles gave, of the points of their cells that have no result yet.
  virtual std::vector<TileTally> scatter() = 0;

  // Calls to the device that computes a tile; others may be called meanwhile.

  // Before all others.
  virtual void connect(DeviceTiles& whole) = 0;
  // As Backend::upload, of a tile that `whole` has gathered.
  virtual void take(DeviceTiles& whole, std::size_t tile) = 0;
  // After the first iteration's fairing: hands its results back. Throws Error(interrupted) if they were given up.
  virtual void give(DeviceTiles& whole, std::size_t tile) = 0;
};

}  // namespace pointfair
