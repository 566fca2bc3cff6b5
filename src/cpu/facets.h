// SPDX-License-Identifier: Apache-2.0
// Method::jones: a vertex goes to where the planes of the faces around it say that it is (docs/methods.md, Eq. 30).
#pragma once

#include <span>
#include <stop_token>

#include "cpu/kernels.h"
#include "seam/mesh_edges.hpp"
#include "seam/settings.hpp"

namespace pointfair::cpu {

struct FacetSource {
  IndexView index;
  NeighborView lists;  // of what edges reach within 2 sigma_c
  const MeshEdges& mesh;
  const MeshFaces& faces;
};

// In sorted order. Memory: 24 bytes a point and 56 a face, while it runs.
void fair_by_facets(const FacetSource& source, const FairingSettings& settings, std::span<Point> out,
                    const std::stop_token& stop);

}  // namespace pointfair::cpu
