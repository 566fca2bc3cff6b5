// SPDX-License-Identifier: Apache-2.0
// What a pipeline tells: estimates of the loaded cloud, and what a run did.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "pointfair/device.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

/// What the cloud itself says, measured once after `load`. Lengths in file units.
struct Estimates {
  std::array<double, 3> min{}, max{};  ///< bounds of the finite points, relative to the cloud's origin
  double diagonal = 0;                 ///< of those bounds
  double spacing = 0;                  ///< mean distance to the 6 nearest other points
  double noise = 0;                    ///< standard deviation of the noise along the normal
  std::uint64_t points = 0;            ///< all
  std::uint64_t finite = 0;            ///< those without NaN or infinity
};

/// Why points kept their place.
struct UnmovedCounts {
  std::uint64_t non_finite = 0;         ///< a coordinate is NaN or infinite, or its square would overflow
  std::uint64_t too_few_neighbors = 0;  ///< fewer than 3 neighbours
  std::uint64_t no_normal = 0;          ///< neighbours identical or on a line
  std::uint64_t outliers = 0;           ///< farther from the surface than noise explains (Params::outliers)
  friend bool operator==(const UnmovedCounts&, const UnmovedCounts&) = default;
};

/// How long one stage took.
struct StageTime {
  std::string name;
  double milliseconds = 0;
};

/// What a run did.
struct Report {
  DeviceInfo device;
  std::uint64_t points = 0;
  Params params;  ///< as used: no `auto` left, lengths in file units
  UnmovedCounts unmoved;
  std::uint64_t short_neighborhoods = 0;  ///< points whose constrained neighbourhood holds fewer than k
  /// The stages that ran, in order; iterations after the first add to the same names. A card's stages are timed on the
  /// card. The paper's normals and fairing are one kernel there; its time is divided three to two. `upload` on a card
  /// lasts until the caller's array may be used again; the index is begun meanwhile.
  std::vector<StageTime> stages;
  /// Into how many tiles the cloud was cut because the card's memory did not suffice; 1: not cut. The stages then are
  /// `cut`, `tiles` and `download`, and the cloud is kept in host memory.
  std::uint64_t tiles = 1;
  double total_milliseconds = 0;                             ///< from array to array
  std::uint64_t peak_host_bytes = 0, peak_device_bytes = 0;  ///< held by the pipeline beside the caller's arrays
};

}  // namespace pointfair
