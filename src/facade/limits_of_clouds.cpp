// SPDX-License-Identifier: Apache-2.0
// The limits of whole clouds, also of those that were computed in zones.
#include <utility>
#include <vector>

#include "io/placed_source.hpp"
#include "pointfair/limits.hpp"
#include "scale/wide_cloud.hpp"

namespace pointfair {

void apply_limits(const Limits& limits, std::span<const std::uint8_t> movable, const Cloud& before, Cloud& after) {
  const scale::Zones zones = after.source == before.source ? scale::Zones{} : scale::zones_of(before);
  if (!zones.are_several()) return apply_limits(limits, movable, before.points, after.points);
  if (before.points.size() != after.points.size() || (!movable.empty() && movable.size() != after.points.size()))
    throw Error(ErrorKind::usage, "limits: the clouds before and after must have as many points");
  if (movable.empty() && limits.strength == 1) return;
  std::vector<Position> from(before.points.size()), to(before.points.size());
  positions(before, from);
  positions(after, to);
  scale::apply_limits_in_zones(zones, limits, movable, from, to);
  after = io::placed(after, std::move(to));
}

void apply_limits(const Limits& limits, const Cloud& before, Cloud& after) {
  apply_limits(limits, movable_points(limits, before), before, after);
}

}  // namespace pointfair
