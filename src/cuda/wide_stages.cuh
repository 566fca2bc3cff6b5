// SPDX-License-Identifier: Apache-2.0
// Normals and fairing wherever the paper's road over lists (stages.cuh) does not suffice: neighbourhoods that are
// balls, filtered normals, offsets to both planes.
#pragma once

#include "cuda/surroundings.cuh"

namespace pointfair::cuda {

// Whether a Gaussian's sigma is a multiple of the ball's radius, or a length.
struct NormalRule {
  point::NormalWeights weights;
  bool of_radius;
};
struct FairingRule {
  point::BilateralWeights weights;
  bool of_radius;
  bool two_planes;                 // Eq. 10 of docs/how-it-works.md instead of the paper's step
  float inverse_turn;              // of Eq. 10
  float strength;                  // share of the displacement that is made
  float squared_outlier_distance;  // 0: outliers are not looked for
  float squared_sparse_core;       // of a ball of the outlier radius
  bool pull_outliers;              // else they become NaN
  const float* squared_radius;     // of each sorted point's ball, for the pull; null over lists
};

// R_i^2 from lists of the `widening` nearest, or as many as there are; lists.k is 0 for none.
void measure_radii(Context& context, const Tree& tree, Lists nearest, float squared_base, float* squared_radius);

// Adds to state->too_few_neighbors and state->no_normal.
void estimate_wide_normals(Context& context, const Tree& tree, CloudState* state, Surroundings surroundings,
                           NormalRule rule, Normals normals);

// What Eq. 20 of docs/how-it-works.md multiplies R_i^2 by.
struct GrowthOut {
  float most;
  float* squared_growth;  // of each sorted point; null: not asked for
};

// One round of Eq. 9.
void filter_normals(Context& context, const Tree& tree, Surroundings surroundings, NormalRule rule, float inverse_turn,
                    Normals from, Normals to, GrowthOut growth);

// How many neighbours each point has, and the least of `values` over it and them.
void survey(Context& context, const Tree& tree, Surroundings surroundings, const float* values, float* counts,
            float* least);

// Collected balls must be without growth; those of leaves where any grows are walked.
void fair_widely(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                 FairingRule rule, FairedPoints faired);

}  // namespace pointfair::cuda
