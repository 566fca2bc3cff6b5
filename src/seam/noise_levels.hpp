// SPDX-License-Identifier: Apache-2.0
// How backends read the levels that settings carry.
#pragma once

#include <algorithm>

#include "point/node_field.h"
#include "point/outliers.h"
#include "seam/settings.hpp"

namespace pointfair {

// A view of the levels, which must outlive it; null: 1 everywhere.
inline point::NodeField field_of(const NodeLevels* levels) {
  if (levels == nullptr) return {};
  const Point& first = levels->first;
  return {levels->levels.data(), levels->nodes, {first.x, first.y, first.z}, levels->nodes_per_unit};
}

// The level at a place; the same bits on every device.
inline float noise_level_at(const NoiseLevels* levels, const Point& p) {
  return point::node_value(field_of(levels), {p.x, p.y, p.z});
}

}  // namespace pointfair
