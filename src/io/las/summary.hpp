// SPDX-License-Identifier: Apache-2.0
// What the header of a LAS file says of all points: their bounds, their number, and how many returns they are.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "io/las/grid.hpp"
#include "io/las/header.hpp"

namespace pointfair::io::las {

/// How many points have each return number.
using ReturnCounts = std::array<std::uint64_t, 16>;

/// A bound that is the same as before keeps its bytes in the header, with which `front` begins, unless the file had
/// wrong ones: then all are written.
void put_bounds(const Scaling& scaling, const GridBounds& before, const GridBounds& now, std::string& front);

/// Takes points that are left out off the numbers in the header, with which `front` begins: `points` in all, `gone` of
/// each return. A number that was wrong does not fall below 0.
void take_off_counts(const ReturnCounts& gone, std::uint64_t points, const Header& header, std::string& front);

}  // namespace pointfair::io::las
