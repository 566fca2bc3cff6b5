// SPDX-License-Identifier: Apache-2.0
// Normals and fairing of all points, over lists or over everything within a radius.
#pragma once

#include "cuda/memory.cuh"
#include "cuda/search.cuh"
#include "cuda/tree.cuh"
#include "point/fairing.h"
#include "point/normal.h"

namespace pointfair::cuda {

// Unit normals in sorted order, an array an axis; zero where there is none.
struct Normals {
  float *x, *y, *z;

  __device__ Vec at(std::size_t i) const { return {x[i], y[i], z[i]}; }
  __device__ void set(std::size_t i, Vec n) const { x[i] = n.x, y[i] = n.y, z[i] = n.z; }
};

// W_a of a neighbour: its mean distance to `power` 2, 1 or 0; `mean_distance` is not read for 0.
struct AreaWeights {
  const float* mean_distance;
  int power;

  __device__ float of(Index at) const {
    if (power == 0) return 1.0f;
    const float length = mean_distance[at];
    return power == 1 ? length : length * length;
  }
};

// Where the neighbours come from: lists of k, or a ball around each point if k is 0.
struct Neighborhoods {
  Lists lists;
  float squared_radius;
};

// Counts state->too_few_neighbors and state->no_normal anew.
void estimate_normals(Context& context, const Tree& tree, CloudState* state, Neighborhoods neighborhoods,
                      point::NormalWeights weights, Normals normals);

// Where moved points go: straight to their places in upload order, or, if `sorted` is not null, there first, to be
// pulled into order through `place_of`, the sorted position of each uploaded point. Random reads of 16 bytes cost half
// of random writes of 12 once a cloud is larger than the cache.
struct FairedPoints {
  Point* in_order;
  float4* sorted;
  const Index* place_of;
};

void find_places(Context& context, const Tree& tree, std::size_t count, Index* place_of);

// Invalid points stay as they are in `points`.
void fair(Context& context, const Tree& tree, Neighborhoods neighborhoods, Normals normals, AreaWeights areas,
          point::BilateralWeights weights, const Point* points, std::size_t count, FairedPoints faired);

// Normals in upload order.
void restore_order(Context& context, const Tree& tree, Normals normals, std::size_t count, Point* out);

}  // namespace pointfair::cuda
