// SPDX-License-Identifier: Apache-2.0
// Normals and fairing wherever the paper's road over lists (stages.cuh) does not suffice: neighbourhoods that are
// balls, filtered normals, offsets to both planes.
#pragma once

#include "cuda/stages.cuh"

namespace pointfair::cuda {

// Everything within a radius: R_i^2 = radius^2 + r_i^2, where r_i is the distance of point i to its `widening`-th
// nearest; the same radius for all if that is 0. A ball that would hold many more than kBallPoints points is thinned to
// about so many, by a hash of the original index. As in src/cpu/kernels.h.
struct Balls {
  const float* squared_radius;  // of each sorted point
  float squared_base;
  int widening;
};
inline constexpr float kBallPoints = 400;

// Lists, or balls if lists.k is 0.
struct Surroundings {
  Lists lists;
  Balls balls;
};

// Whether a Gaussian's sigma is a multiple of the ball's radius, or a length.
struct NormalRule {
  point::NormalWeights weights;
  bool of_radius;
};
struct FairingRule {
  point::BilateralWeights weights;
  bool of_radius;
  bool two_planes;     // Eq. 10 of docs/how-it-works.md instead of the paper's step
  float inverse_turn;  // of Eq. 10
  float strength;      // share of the displacement that is made
};

// R_i^2 from lists of the `widening` nearest, or as many as there are; lists.k is 0 for none.
void measure_radii(Context& context, const Tree& tree, Lists nearest, float squared_base, float* squared_radius);

// Adds to state->too_few_neighbors and state->no_normal.
void estimate_wide_normals(Context& context, const Tree& tree, CloudState* state, Surroundings surroundings,
                           NormalRule rule, Normals normals);

// One round of Eq. 9.
void filter_normals(Context& context, const Tree& tree, Surroundings surroundings, NormalRule rule, float inverse_turn,
                    Normals from, Normals to);

void fair_widely(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                 FairingRule rule, FairedPoints faired);

}  // namespace pointfair::cuda
