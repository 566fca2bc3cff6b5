// SPDX-License-Identifier: Apache-2.0
// What belongs to each sorted point, as the bodies of src/point/stages.h read it.
#pragma once

#include "cuda/index/tree.cuh"

namespace pointfair::cuda {

// Unit normals in sorted order, an array an axis; zero where there is none.
struct Normals {
  float *x, *y, *z;

  __device__ Vec at(std::size_t i) const { return {x[i], y[i], z[i]}; }
  __device__ void set(std::size_t i, Vec n) const { x[i] = n.x, y[i] = n.y, z[i] = n.z; }
};

// One number of each sorted point.
struct Scalars {
  const float* values;
  __device__ float of(Index at) const { return values[at]; }
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

}  // namespace pointfair::cuda
