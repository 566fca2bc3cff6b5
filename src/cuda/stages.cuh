// SPDX-License-Identifier: Apache-2.0
// The paper's normals and fairing of all points, over lists.
#pragma once

#include "cuda/memory.cuh"
#include "cuda/tree.cuh"
#include "point/fairing.h"
#include "point/normal.h"
#include "pointfair/cloud.hpp"

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

// list[(leaf * k + slot) * 32 + lane], nearest first; sorted positions, kNoNeighbor at the end.
struct Lists {
  int k;
  const Index* list;

  __device__ const Index* of(std::size_t at) const { return list + (at / kWarp * k) * kWarp + at % kWarp; }
};

// Adds to state->too_few_neighbors and state->no_normal.
void estimate_normals(Context& context, const Tree& tree, CloudState* state, Lists lists, point::NormalWeights weights,
                      Normals normals);

// Where moved points go: straight to their places in upload order, or, if `staged` is not null, into `in_order` as they
// are sorted, with their original indices in `originals`, to be brought into order by way of `staged`. Invalid points
// stay as they are in `input`.
struct FairedPoints {
  Point* in_order;
  const Point* input;  // in upload order
  std::size_t count;
  Point* staged;
  Index *originals, *staged_originals;
};

// From where the kernels put them, if faired.staged is not null.
void bring_into_order(Context& context, FairedPoints faired);

void fair(Context& context, const Tree& tree, Lists lists, Normals normals, AreaWeights areas,
          point::BilateralWeights weights, FairedPoints faired);

// Both over lists, as one kernel, for the points of some leaves.
void estimate_normals_and_fair(Context& context, const Tree& tree, CloudState* state, LeafRange leaves, Lists lists,
                               point::NormalWeights weights, Normals normals, AreaWeights areas,
                               point::BilateralWeights fairing_weights, FairedPoints faired);

// The same without area weights, only for the points whose places in upload order are in [begin, end), straight to
// their places.
void estimate_normals_and_fair_between(Context& context, const Tree& tree, CloudState* state, Lists lists,
                                       point::NormalWeights weights, Normals normals,
                                       point::BilateralWeights fairing_weights, FairedPoints faired, std::size_t begin,
                                       std::size_t end);

// Normals in upload order.
void restore_order(Context& context, const Tree& tree, Normals normals, std::size_t count, Point* out);

}  // namespace pointfair::cuda
