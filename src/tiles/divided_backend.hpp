// SPDX-License-Identifier: Apache-2.0
// A backend for a cloud that lies whole on one device, and whose stages several devices share.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "seam/backend.hpp"

namespace pointfair {

// The cloud lies on the device that `of_devices[0]` makes, which measures it and gives the results. Its iterations are
// computed in tiles, one for each device at a time, and a device may be named twice. Results have the bits of one
// device: each point tells whether its neighbourhood was in its tile (tile_run.hpp), and is computed again if not. If
// the memory of some device does not suffice, the tiles are halved. Null if such devices share no cloud.
std::unique_ptr<Backend> make_divided_backend(std::vector<std::function<std::unique_ptr<Backend>()>> of_devices);

}  // namespace pointfair
