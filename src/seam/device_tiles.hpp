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

// A tile: the results of the points in a cell are wanted, and all points in a region around it are loaded.
struct DeviceTile {
  point::Cell cell;
  point::Region loaded;
};

// The results of a tile, counted.
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

  // Begins the tiles of an iteration. Its input is that of all tiles from now on, and no result is there yet. None is
  // expected of invalid points.
  virtual void begin_tiles(int iteration) = 0;
  // Gathers the valid points of up to kMostTiles regions, and returns the number of each.
  virtual std::vector<std::size_t> gather(std::span<const DeviceTile> tiles) = 0;
  // The numbers of a tile's gathered points, in the order in which take() copies them.
  virtual std::vector<std::uint32_t> gathered(std::size_t tile) = 0;
  // Takes the results of all gathered tiles, for the points of their cells that have none yet.
  virtual std::vector<TileTally> scatter() = 0;

  // Calls to the device that computes a tile; others may be called meanwhile.

  // The first call: names the device that holds the cloud.
  virtual void connect(DeviceTiles& whole) = 0;
  // As Backend::upload, of a tile that `whole` has gathered.
  virtual void take(DeviceTiles& whole, std::size_t tile) = 0;
  // After the first iteration's fairing: hands the tile's results back. Throws Error(interrupted) if stages
  // were given up.
  virtual void give(DeviceTiles& whole, std::size_t tile) = 0;
};

}  // namespace pointfair
