// SPDX-License-Identifier: Apache-2.0
// Whether a cloud is computed as a whole in memory or in tiles on disk. Whether it is computed in zones follows from
// its extent, in both ways alike (zones.hpp).
#pragma once

#include <cstdint>
#include <string>

#include "pointfair/device.hpp"
#include "pointfair/params.hpp"

namespace pointfair::scale {

/// The bytes of host memory that a choice counts with.
struct HostMemory {
  std::uint64_t given = 0;  ///< that a run may take; 0: not said
  std::uint64_t free = 0;   ///< that the process can take now

  /// Half of what is free, where nothing is said: other programs need some too.
  std::uint64_t usable() const { return given != 0 ? given : free / 2; }
};

/// Of a tile's point, on the host: what a pipeline holds (pipeline.hpp), and beside it the input, the result and what
/// became of the point.
std::uint64_t bytes_of_tile_point(const Params& params);
/// What a whole cloud takes of the host's memory at most, with its input and its result. A card holds what is computed.
std::uint64_t bytes_in_memory(std::uint64_t points, const Params& params, Device::Kind device);

/// The choice: tiles where the whole cloud takes more than is usable. Pure.
bool needs_tiles(std::uint64_t points, const Params& params, Device::Kind device, const HostMemory& memory);

/// Why these parameters need the whole cloud around one origin, in a sentence for the user; empty if they do not.
std::string why_not_in_parts(const Params& params);

}  // namespace pointfair::scale
