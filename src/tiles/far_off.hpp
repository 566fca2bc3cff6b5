// SPDX-License-Identifier: Apache-2.0
// Points that lie so far from all others that a box which holds the nearest of these holds more than fits: strays of a
// survey. Whether one is isolated follows from its nearest points alone, where they are all about as far as the
// nearest.
#pragma once

#include <optional>
#include <stop_token>

#include "tiles/tile_run.hpp"

namespace pointfair {

struct Isolated {
  Point result;
  unsigned char outcome;  // point::Outcome
};
// The result of the point at a place, if it is one that keeps its place with the whole cloud loaded, too. Null: it does
// not, or that does not follow from what the store loads around it.
std::optional<Isolated> isolated_at(const Point& place, PointStore& store, const FramedSettings& stages,
                                    TileWorker& worker, const std::stop_token& stop);

}  // namespace pointfair
