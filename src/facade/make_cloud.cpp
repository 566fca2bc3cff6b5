// SPDX-License-Identifier: Apache-2.0
// Clouds of positions in the caller's memory.
#include <utility>

#include "io/array_source.hpp"
#include "io/placed_source.hpp"
#include "pointfair/positions.hpp"
#include "scale/zones.hpp"

namespace pointfair {

Cloud make_cloud(std::span<const Position> positions) {
  io::PlacedArray placed = io::place_array(positions);
  const double side = scale::zone_side(std::move(placed.sample), positions.size(), placed.cloud.origin, 0);
  if (!(side > 0)) return std::move(placed.cloud);
  return io::placed(placed.cloud, {positions.begin(), positions.end()}, ScalarType::float64);
}

}  // namespace pointfair
