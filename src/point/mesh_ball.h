// SPDX-License-Identifier: Apache-2.0
// What a point looks for along the edges of a mesh.
#pragma once

#include "point/neighborhoods.h"

namespace pointfair::point {

// Paths of edges stay within the limit, which a radius that grows does not leave. Where the neighbourhood is thinned,
// it holds the share of what they reach whose hashes are less.
struct MeshBall {
  float squared_near, squared_limit, share;
};
POINTFAIR_INLINE MeshBall mesh_ball_of(const Radii& radii, Index at, float growth) {
  const float own = radii.squared_radius[at], widest = own * (growth * growth);
  if (radii.min_neighbors == 0) return {own, widest, 1};
  const float level = radii.squared_level == nullptr ? 1.0f : radii.squared_level[at];
  return {own, widest, kept_share(radii, level, own, widest)};
}

// Of one vertex. Neighbourhoods do not lead through vertices of more: the hub of a fan is everybody's neighbour.
inline constexpr unsigned kMostMeshEdges = 512;

}  // namespace pointfair::point
