// SPDX-License-Identifier: Apache-2.0
// Copies within the host's memory.
#pragma once

#include <span>

#include "pointfair/cloud.hpp"

namespace pointfair {

// All threads share the work. `to` has as many points.
void copy_by_all_threads(std::span<const Point> from, Point* to);

}  // namespace pointfair
