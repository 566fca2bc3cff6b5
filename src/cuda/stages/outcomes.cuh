// SPDX-License-Identifier: Apache-2.0
// Which results would be the same if points beyond a region were loaded too.
#pragma once

#include "cuda/stages/wide_stages.cuh"
#include "point/region.h"

namespace pointfair::cuda {

struct OutcomeQuery {
  point::Region loaded;
  point::ListRule rule;        // if neighbourhoods are lists
  point::NodeField reach;      // its levels, if neighbourhoods have a radius
  const float* mean_distance;  // null if no area weight reads it
  int filter_rounds;
  bool reads_normals;        // of neighbours
  bool reads_displacements;  // of neighbours
  bool along_mesh;           // of which all is loaded
};

// As Backend::outcomes, `out` on the card. The step reads the radii as `surroundings` has them, all else without
// growth.
void find_outcomes(Context& context, const Tree& tree, Surroundings surroundings, Normals normals,
                   const OutcomeQuery& query, std::size_t count, unsigned char* out);

}  // namespace pointfair::cuda
