// SPDX-License-Identifier: Apache-2.0
// Tiles of a cloud on the card: their points side by side, and their results back among all points.
// Memory: 17 bytes for each point of the tiles that are gathered at once, and 1 for each point of the cloud.
#pragma once

#include <span>
#include <vector>

#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/transfer.cuh"
#include "point/vec.h"
#include "pointfair/cloud.hpp"
#include "seam/device_tiles.hpp"

namespace pointfair::cuda {

// As pointfair::TileTally, with bounds as ordered() floats.
struct TallyOnCard {
  unsigned min[3], max[3], left;
  unsigned too_few, no_normal, is_short;
};

class GatheredTiles {
 public:
  explicit GatheredTiles(Context& context);

  // `input` and `results` hold `count` points, and stay as they are until the last scatter(). Copies invalid points.
  void begin(const Point* input, std::size_t count, Point* results);
  // Waits for the numbers of points, and only starts the rest.
  std::vector<std::size_t> gather(std::span<const DeviceTile> tiles);
  std::vector<unsigned> indices_of(std::size_t tile) const;
  std::vector<TileTally> scatter();

  // What another card reads and writes of a gathered tile: its points, which its results take the place of, and its
  // outcomes.
  struct Share {
    const DeviceTile& tile;
    std::size_t count;
    Point* points;
    unsigned char* outcomes;
    cudaEvent_t there;
  };
  Share share(std::size_t tile) const;

 private:
  std::size_t size_of(std::size_t tile) const { return starts_[tile + 1] - starts_[tile]; }

  Context& context_;
  const Point* input_ = nullptr;
  Point* results_ = nullptr;
  std::size_t count_ = 0;
  std::vector<DeviceTile> tiles_;
  std::vector<std::size_t> starts_{0};  // of each tile among all gathered points, and the end
  DeviceArray<unsigned char> done_, outcomes_;
  DeviceArray<unsigned> indices_, totals_;
  DeviceArray<Point> points_;
  DeviceArray<TallyOnCard> tallies_;
  Pinned<unsigned> fetched_totals_;
  Pinned<TallyOnCard> fetched_tallies_;
  Event there_;
};

}  // namespace pointfair::cuda
