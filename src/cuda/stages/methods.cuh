// SPDX-License-Identifier: Apache-2.0
// The methods other than the bilateral one (docs/methods.md), over lists or radius neighbourhoods.
#pragma once

#include "cuda/stages/wide_stages.cuh"
#include "point/method.h"

namespace pointfair::cuda {

// Every point's displacement into `displacements`, then the moved points, in which those of the neighbours may count.
void fair_by_method(Context& context, const Tree& tree, Surroundings surroundings, Normals normals, AreaWeights areas,
                    const point::MethodRule& rule, const point::Sensors& sensors, Normals displacements,
                    FairedPoints faired);

}  // namespace pointfair::cuda
