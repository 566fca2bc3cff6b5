// SPDX-License-Identifier: Apache-2.0
// A backend for clouds that its workers cannot hold at once.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "seam/backend.hpp"

namespace pointfair {

struct Tiling {
  std::uint64_t tiles = 2;                        // at least
  std::uint64_t most_points = ~std::uint64_t{0};  // that are uploaded to one worker
  double first_halo = 1;                          // of the width that is thought to suffice
  std::size_t feeders = 1;                        // threads that hand tiles to workers, each to as many of them
};

class TiledBackend : public Backend {
 public:
  // How many tiles the next cloud is cut into, at least.
  virtual void cut_into(std::uint64_t tiles) = 0;
};

// The cloud stays in host memory; as many tiles at once are computed as there are `workers`. Those that follow each
// other have a feeder together: the workers of one card. A feeder takes the next tile when one of its workers is free,
// so faster cards do more. Results have the bits of the whole cloud on one worker.
std::unique_ptr<TiledBackend> make_tiled_backend(std::vector<std::unique_ptr<Backend>> workers, Tiling tiling);

}  // namespace pointfair
