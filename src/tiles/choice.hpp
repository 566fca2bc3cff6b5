// SPDX-License-Identifier: Apache-2.0
// The one place that decides whether a cloud is computed as a whole or in tiles, and in how many: pure functions of
// points, parameters, devices and memory. Whether it is computed in zones follows from its extent, in all ways alike
// (scale/zones.hpp).
#pragma once

#include <cstdint>
#include <string>

#include "pointfair/device.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

/// Points; smaller tiles do not need less memory.
inline constexpr std::uint64_t kLeastTile = 2000;
/// Bytes of the program itself, its threads and tables.
inline constexpr std::uint64_t kProcessBytes = std::uint64_t{40} << 20;

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

/// Tiles on disk where the whole cloud takes more than is usable.
bool needs_tiles(std::uint64_t points, const Params& params, Device::Kind device, const HostMemory& memory);
/// Why these parameters need the whole cloud around one origin, in a sentence for the user; empty if they do not.
/// `into_folder`: the files are one cloud, in tiles whatever the memory is, so that each on its own is the way on.
std::string why_not_in_parts(const Params& params, bool into_folder = false);

/// How many points a task on disk may hold, each with everything that it needs for it.
std::uint64_t points_in_memory(std::uint64_t memory, std::uint64_t bytes_per_point);
/// The same of a tile with what lies around it.
std::uint64_t points_of_tile(std::uint64_t memory, const Params& params);
/// Into how many tiles a cloud on disk is cut, and what a task of one of them takes.
std::uint64_t tiles_on_disk(std::uint64_t points, const Params& params, std::uint64_t memory);
std::uint64_t bytes_of_tile(std::uint64_t points, std::uint64_t tiles, const Params& params, std::uint64_t memory);

/// Devices of one host that may share a cloud in its memory.
struct Cards {
  std::uint64_t count = 1;
  std::uint64_t worth_dividing = 1 << 22;  ///< points, from which on several share (docs/decisions/128)
};
bool share(const Cards& cards, std::uint64_t points);
/// Into how many tiles a cloud is cut that several share.
std::uint64_t tiles_of(const Cards& cards, std::uint64_t points);
/// The same after the memory of a device did not suffice for so many tiles; 0: more would not help.
std::uint64_t more_tiles(const Cards& cards, std::uint64_t points, std::uint64_t tiles);

}  // namespace pointfair
