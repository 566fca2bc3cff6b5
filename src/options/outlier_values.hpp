// SPDX-License-Identifier: Apache-2.0
// The values that an action on outliers writes, for any points of a cloud.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "options/height_grid.hpp"
#include "pointfair/outliers.hpp"

namespace pointfair {

/// Whether it asks what lies above the surface and what below.
inline bool needs_heights(const OutlierAction& action) {
  return action.kind == OutlierAction::Kind::classify && !action.value;
}

/// Throws ErrorKind::usage unless classes and flags fit into an attribute of this shape.
void check_outlier_attribute(const AttributeInfo& info);

/// Puts the values of the outliers among some points into `values`, which the action has none for if it is empty, and
/// counts them. `has_old_classes` as in FileInfo. `classes`: what the points had before, or empty; they may lie where
/// the values do.
void put_outlier_values(const OutlierAction& action, bool has_old_classes, std::span<const std::uint8_t> reasons,
                        std::span<const Point> before, const HeightGrid& heights, std::span<const std::byte> classes,
                        std::span<std::byte> values, OutlierOutcome& outcome);

}  // namespace pointfair
