// SPDX-License-Identifier: Apache-2.0
// The layers of the net of src/point/net.h, kernel by kernel. Each only starts its work.
//
// Of one point: 156,000 products of a weight, half of them of matrices, which tensor cores take; 5,400 values of edges,
// each of which takes seven instructions, 2.5 ms of an H100 at 1M points, the least they can take; 16 rows of 96 bytes
// in each of seven layers, mostly from the cache.
#pragma once

#include "cuda/net/net_cloud.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

// What the points read of a scale.
void measure_scale(Context& context, const NetCloud& cloud, int scale, const Index* list);
// Normals on the side of the neighbours, sides, and the first state, from all scales.
void begin_net(Context& context, const NetCloud& cloud, const net::Weights& weights);
// What a layer keeps of each point for its neighbours.
void store_for_neighbors(Context& context, const NetCloud& cloud, const net::Layer& layer);
// New states, and their share of the step where gates weigh one; `scale` is that of the layer.
void run_layer(Context& context, const NetCloud& cloud, const net::Layer& layer, int scale, const Index* list);
// The refined positions of points that move, to their places in upload order. `held`: 1 keeps its place.
void end_net(Context& context, const NetCloud& cloud, const net::Weights& weights, const Tree& tree,
             const std::uint8_t* held, Point* out);

}  // namespace pointfair::cuda
