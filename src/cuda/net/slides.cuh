// SPDX-License-Identifier: Apache-2.0
// How points slide apart along the surface before the net reads them (src/point/net.h). Each only starts its work.
#pragma once

#include "cuda/net/net_cloud.cuh"
#include "cuda/runtime/memory.cuh"

namespace pointfair::cuda {

// A round in which points slide apart along the surface, `from` one place `to` the next; the list of the finest scale.
void slide(Context& context, const NetCloud& cloud, const Index* list, const Vec* from, Vec* to);
// Where points begin to slide, to cloud.step; and from there the end, which the net reads as classical places.
void begin_slides(Context& context, const NetCloud& cloud);
void end_slides(Context& context, const NetCloud& cloud);

}  // namespace pointfair::cuda
