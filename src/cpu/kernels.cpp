// SPDX-License-Identifier: Apache-2.0
// The stage kernels, compiled once per instruction set with POINTFAIR_ISA naming it. Includes nothing whose inline
// functions could be shared with code for a lesser processor.
#include "cpu/kernels.h"

#include "cpu/distances.h"
#include "cpu/growth.h"
#include "cpu/hilbert.h"
#include "cpu/method_loops.h"
#include "cpu/pack.h"
#include "cpu/sample_fields.h"
#include "cpu/sample_fits.h"
#include "cpu/search.h"
#include "cpu/search_alone.h"
#include "cpu/search_there.h"
#include "cpu/stage_loops.h"

namespace pointfair::cpu::POINTFAIR_ISA {

static void nearest(const IndexView& index, Index leaf, int k, float squared_limit, Index* out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    if (start + kLanes > index.points)  // lanes without a point
      for (int s = 0; s < k; ++s) store(out + s * kLeafSize + part, broadcast(int(point::kNoNeighbor)));
    if (start < index.points) search_lanes(index, start, 0, kLanes, k, squared_limit, out + part);
  }
}

extern const Kernels kKernels;
const Kernels kKernels = {
    POINTFAIR_ISA_LABEL,
    hilbert_keys,
    curve_keys,
    nearest,
    nearest_distances,
    listed_distances,
    grow,
    squared_levels,
    squared_radii,
    mean_distances,
    normals,
    filter_normals,
    fair,
    displacements,
    move,
    survey,
    nearest_there,
    child_gaps,
    leaf_distances,
    {noise_of_rounds<point::kFirstRow, 0, point::kFirstRounds>,
     noise_of_rounds<point::kLastRow, point::kFirstRounds, point::kRounds>, residuals_of, beyond_two_sigmas,
     mean_said, exponentials}};

}  // namespace pointfair::cpu::POINTFAIR_ISA
