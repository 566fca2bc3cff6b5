// SPDX-License-Identifier: Apache-2.0
// The nearest neighbours of all points, for methods of one's own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"

namespace pointfair {

inline constexpr std::uint32_t kNoNeighbor = 0xFFFFFFFF;

/// The `k` nearest other points of each point, k indices a point, nearest first, of equally near ones that with the
/// lower index; kNoNeighbor where there are fewer. A point that is not finite has no neighbours and is nobody's.
/// O(N log N); 4 k bytes a point. Throws ErrorKind::memory if these are too many, ErrorKind::interrupted.
POINTFAIR_EXPORT std::vector<std::uint32_t> nearest_neighbors(std::span<const Point> points, std::size_t k,
                                                              std::stop_token stop = {});

}  // namespace pointfair
