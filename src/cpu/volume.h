// SPDX-License-Identifier: Apache-2.0
// The volume that a closed mesh encloses, and displacements that keep it (Desbrun 1999).
#pragma once

#include <vector>

#include "cpu/weighted_graph.h"
#include "point/vec.h"

namespace pointfair::cpu {

// Scales each connected part of the mesh, once displaced, about the mean of its vertices, so that it encloses the
// volume that it had. A part whose volume has vanished or changed its sign stays as it is. `source.faces` enclose a
// volume; displacements are in sorted order, and those of points that are no vertex are not read.
void keep_volumes(const GraphSource& source, std::vector<point::Vec3<double>>& displacements);

}  // namespace pointfair::cpu
