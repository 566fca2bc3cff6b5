// SPDX-License-Identifier: Apache-2.0
// The paper's normals and fairing of all points, over lists.
#pragma once

#include "cuda/runtime/memory.cuh"
#include "cuda/search/lists.cuh"
#include "cuda/stages/values.cuh"
#include "point/fairing.h"
#include "point/normal.h"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

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

// Normals in upload order.
void restore_order(Context& context, const Tree& tree, Normals normals, std::size_t count, Point* out);

}  // namespace pointfair::cuda
