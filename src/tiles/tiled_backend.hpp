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
};

// The cloud stays in host memory; as many tiles at once are computed as there are `workers`, which are backends of one
// device. Results have the bits of the whole cloud on one of them.
std::unique_ptr<Backend> make_tiled_backend(std::vector<std::unique_ptr<Backend>> workers, Tiling tiling);

}  // namespace pointfair
