// SPDX-License-Identifier: Apache-2.0
// What differs from place to place of a cloud.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// Values at the nodes of a cubic grid: of a length that differs from place to place, over that of a typical place.
inline constexpr int kFieldNodes = 32;  // along each axis
struct NodeField {
  const float* values;   // [z][y][x], kFieldNodes of each; null: 1 everywhere
  Vec3<float> first;     // the node of least coordinates
  float nodes_per_unit;  // of length
};

struct NodePlace {
  int below;
  float above;  // the share of the node after it
};
// Places before the first node or behind the last are as these; so is NaN.
POINTFAIR_INLINE NodePlace node_place(float coordinate, float first, float nodes_per_unit) {
  float nodes = (coordinate - first) * nodes_per_unit;
  nodes = select(nodes > 0.0f, nodes, 0.0f);
  nodes = smaller(nodes, static_cast<float>(kFieldNodes - 1));
  const int below = nodes < static_cast<float>(kFieldNodes - 2) ? static_cast<int>(nodes) : kFieldNodes - 2;
  return {below, nodes - static_cast<float>(below)};
}

POINTFAIR_INLINE float between(float from, float to, float share) { return from + share * (to - from); }

// Trilinear. A translation that leaves all differences of coordinates exact changes no bit.
POINTFAIR_INLINE float node_value(const NodeField& field, Vec3<float> p) {
  if (field.values == nullptr) return 1.0f;
  const NodePlace x = node_place(p.x, field.first.x, field.nodes_per_unit),
                  y = node_place(p.y, field.first.y, field.nodes_per_unit),
                  z = node_place(p.z, field.first.z, field.nodes_per_unit);
  const float* const corner = field.values + (z.below * kFieldNodes + y.below) * kFieldNodes + x.below;
  float face[2];
  for (int k = 0; k < 2; ++k) {
    const float* const low = corner + k * kFieldNodes * kFieldNodes;
    const float* const high = low + kFieldNodes;
    face[k] = between(between(low[0], low[1], x.above), between(high[0], high[1], x.above), y.above);
  }
  return between(face[0], face[1], z.above);
}

}  // namespace pointfair::point
