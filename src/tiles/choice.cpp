// SPDX-License-Identifier: Apache-2.0
#include "tiles/choice.hpp"

#include <algorithm>
#include <cmath>

#include "pointfair/cloud.hpp"

namespace pointfair {
namespace {

constexpr double kCoreShare = 0.7;          // of a tile's points; the rest is halo
constexpr std::uint64_t kFirstTiles = 4;    // of a cloud that does not fit
constexpr std::uint64_t kBytesOfNet = 760;  // a point, in all; 677 were measured (docs/learned.md)
constexpr std::uint64_t kTilesOfCard = 8;   // of several: while cards wait for the last tile, few points are left

}  // namespace

std::uint64_t bytes_of_tile_point(const Params& params) {
  const int k = params.k == kAutomatic ? 0 : params.k;
  return 162 + 8 * static_cast<std::uint64_t>(k);
}

std::uint64_t bytes_in_memory(std::uint64_t points, const Params& params, Device::Kind device) {
  constexpr std::uint64_t kBesideCard = 64;
  if (device == Device::cuda) return points * kBesideCard;
  return points * (params.method == Method::learned ? kBytesOfNet : bytes_of_tile_point(params) + 2 * sizeof(Point));
}

bool needs_tiles(std::uint64_t points, const Params& params, Device::Kind device, const HostMemory& memory) {
  return bytes_in_memory(points, params, device) > memory.usable();
}

std::string why_not_in_parts(const Params& params, bool into_folder) {
  const auto why = [&](const std::string& flag, const std::string& reason, const std::string& advice) {
    return flag + " cannot be used with a run in tiles on disk" + reason + "; " +
           (into_folder
                ? "files of --out-dir are one cloud in tiles, and pointfair run --each treats every file on its own"
                : advice);
  };
  if (params.connectivity == Connectivity::mesh)
    return why("--connectivity mesh", ", which reads no faces",
               "give it the memory for the whole mesh, or leave it out");
  if (params.method == Method::implicit)
    return why("--method implicit", ": one system of equations holds all points",
               "give it the memory for the whole cloud, or use another method");
  if (params.method == Method::learned)
    return why("--method learned", ": a point's result depends on points at any distance",
               "give it the memory for the whole cloud, " + std::to_string(kBytesOfNet) +
                   " bytes a point, or use another method");
  return {};
}

std::uint64_t points_in_memory(std::uint64_t memory, std::uint64_t bytes_per_point) {
  const std::uint64_t free = memory > 2 * kProcessBytes ? memory - kProcessBytes : memory / 2;
  return std::max<std::uint64_t>(1000, free / bytes_per_point);
}

std::uint64_t points_of_tile(std::uint64_t memory, const Params& params) {
  return points_in_memory(memory, bytes_of_tile_point(params));
}

std::uint64_t tiles_on_disk(std::uint64_t points, const Params& params, std::uint64_t memory) {
  return std::uint64_t(std::ceil(double(points) / (kCoreShare * double(points_of_tile(memory, params)))));
}

std::uint64_t bytes_of_tile(std::uint64_t points, std::uint64_t tiles, const Params& params, std::uint64_t memory) {
  const double of_tile = double(points) / double(tiles) / kCoreShare;
  return std::min(memory, kProcessBytes + static_cast<std::uint64_t>(of_tile) * bytes_of_tile_point(params));
}

bool share(const Cards& cards, std::uint64_t points) { return cards.count > 1 && points >= cards.worth_dividing; }

std::uint64_t tiles_of(const Cards& cards, std::uint64_t points) {
  return std::clamp(4 * points / cards.worth_dividing, 2 * cards.count, kTilesOfCard * cards.count);
}

std::uint64_t more_tiles(const Cards& cards, std::uint64_t points, std::uint64_t tiles) {
  const std::uint64_t more = std::max(kFirstTiles, 2 * tiles);
  if (points / more < kLeastTile) return 0;
  return cards.count > 1 ? std::max(more, kTilesOfCard * cards.count) : more;
}

}  // namespace pointfair
