// SPDX-License-Identifier: Apache-2.0
// Normals and fairing for all that the paper's stages over lists (list_stages.cuh) do not have: neighbourhoods within a
// radius, filtered normals, symmetric offsets.
#pragma once

#include "cuda/stages/surroundings.cuh"
#include "point/node_field.h"

namespace pointfair::cuda {

// Where the tree has settings of its clouds, every function here reads those in place of its arguments.

// Squares of the field's levels, of each sorted point.
void measure_levels(Context& context, const Tree& tree, point::NodeField field, float* squared_level);

// R_i^2 by `of`, from lists of the `min_neighbors` nearest points or more, or of as many as there are; nearest.k is 0
// where there are no lists. `further_share` receives point::further_share of each sorted point; null: not asked for.
void measure_radii(Context& context, const Tree& tree, Lists nearest, const point::Radii& of,
                   point::NodeField reach_levels, float* squared_radius, float* further_share);

// Adds to state->too_few_neighbors and state->no_normal.
void estimate_wide_normals(Context& context, const Tree& tree, CloudState* state, Surroundings surroundings,
                           const point::NormalSettings& settings, Normals normals);

// One round of Eq. 9, of which each point takes its share (null: all). `squared_growth` receives what Eq. 20 of
// docs/how-it-works.md multiplies R_i^2 of each sorted point by; null: not asked for.
void filter_normals(Context& context, const Tree& tree, Surroundings surroundings,
                    const point::NormalSettings& settings, Normals from, const float* further_share, Normals to,
                    float* squared_growth);

// Leaves are surveyed unless they end deeper than the deepest 0; both as ordered() floats, on the card.
struct SurveyedLeaves {
  const unsigned *ends, *deepest_zero;
};
// How many neighbours each point has, and the least of `values`, 0 or 1, over it and them; 0 and 1 in other leaves.
void survey(Context& context, const Tree& tree, Surroundings surroundings, const float* values, float* counts,
            float* least, SurveyedLeaves leaves);

// `sensors` on the card. Collected neighbourhoods must be without growth; those of leaves where any grows are walked.
void fair_widely(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                 const point::FairingSettings& settings, const point::Sensors& sensors, point::Levels levels,
                 FairedPoints faired);

}  // namespace pointfair::cuda
