// SPDX-License-Identifier: Apache-2.0
#include "scale/choice.hpp"

#include "pointfair/cloud.hpp"

namespace pointfair::scale {

std::uint64_t bytes_of_tile_point(const Params& params) {
  const int k = params.k == kAutomatic ? 0 : params.k;
  return 162 + 8 * static_cast<std::uint64_t>(k);
}

std::uint64_t bytes_in_memory(std::uint64_t points, const Params& params, Device::Kind device) {
  constexpr std::uint64_t kBesideCard = 64;
  return points * (device == Device::cuda ? kBesideCard : bytes_of_tile_point(params) + 2 * sizeof(Point));
}

bool needs_tiles(std::uint64_t points, const Params& params, Device::Kind device, const HostMemory& memory) {
  return bytes_in_memory(points, params, device) > memory.usable();
}

std::string why_not_in_parts(const Params& params) {
  if (params.connectivity == Connectivity::mesh)
    return "--connectivity mesh cannot be used with a run in tiles on disk, which reads no faces; give it the memory "
           "for the whole mesh, or leave it out";
  if (params.method == Method::implicit)
    return "--method implicit cannot be used with a run in tiles on disk: one system of equations holds all points; "
           "give it the memory for the whole cloud, or use another method";
  if (params.method == Method::learned)
    return "--method learned cannot be used with a run in tiles on disk: a point's result depends on points at any "
           "distance; give it the memory for the whole cloud, 760 bytes a point, or use another method";
  return {};
}

}  // namespace pointfair::scale
