// SPDX-License-Identifier: Apache-2.0
// The layers of the net of src/point/net.h, kernel by kernel. Each only starts its work.
//
// Of one point: 400,000 products of a weight, which tensor cores take; 5,400 values of edges, each of which takes about
// five instructions, 1.6 ms of an H100 at 1M points; 16 rows of 48 bytes in each of seven layers, mostly from the
// cache.
#pragma once

#include "cuda/net/net_cloud.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

// Of the points of some leaves; `list`: as those of lists.cuh, valid for these leaves.

// What they read of a scale.
void measure_scale(Context& context, const NetCloud& cloud, LeafRange part, int scale, const Index* list);
// Normals on the side of the neighbours, sides, and the first state, from all scales.
void begin_net(Context& context, const NetCloud& cloud, LeafRange part, const net::Weights& weights);
// The next states, and their share of the step where gates weigh one; `scale` is that of the layer. `clamps`: whether
// what neighbours add may need more than its 16 bits.
void run_layer(Context& context, const NetCloud& cloud, LeafRange part, const net::Layer& layer, int scale,
               const Index* list, bool clamps);

// The refined positions of points that move, to their places in upload order. `held`: 1 keeps its place.
void end_net(Context& context, const NetCloud& cloud, const net::Weights& weights, const Tree& tree,
             const std::uint8_t* held, Point* out);

}  // namespace pointfair::cuda
