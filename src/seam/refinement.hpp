// SPDX-License-Identifier: Apache-2.0
// The last stage of method learned, on the host's cores whatever the device: a net refines what the stages made of a
// whole cloud (src/point/net.h).
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>

#include "pointfair/cloud.hpp"
#include "seam/net_weights.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// A row for each point, in upload order.
struct Classical {
  std::span<const Point> measured, points, normals;
  std::span<const float> noise;
  std::span<const std::uint8_t> held;  // 1: keeps its place
};

// Writes the refined points to `out`, which may be `classical.points`. Points that are held, that have no normal or
// that know no noise keep their classical place. A point's result depends on those that its lists of neighbours reach,
// layer by layer, in all kScales scales: on no bound of distance. The frame is the cloud's. 640 bytes a point. Runs on
// the threads of the arena that calls it.
void refine(const Classical& classical, const NetWeights& weights, const Frame& frame, std::span<Point> out,
            const std::stop_token& stop);

}  // namespace pointfair
