// SPDX-License-Identifier: Apache-2.0
// What differs from place to place of a cloud.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// Values at the nodes of a cubic grid: of a length that differs from place to place, over that of a typical place.
struct NodeField {
  const float* values;   // [z][y][x], `nodes` of each; null: 1 everywhere
  int nodes;             // along each axis, at least 2
  Vec3<float> first;     // the node of least coordinates
  float nodes_per_unit;  // of length
};

struct NodePlace {
  int below;
  float above;  // the share of the node after it
};
// Places before the first node or behind the last are as these; so is NaN.
POINTFAIR_INLINE NodePlace node_place(const NodeField& field, float coordinate, float first) {
  float place = (coordinate - first) * field.nodes_per_unit;
  place = select(place > 0.0f, place, 0.0f);
  place = smaller(place, static_cast<float>(field.nodes - 1));
  const int below = place < static_cast<float>(field.nodes - 2) ? static_cast<int>(place) : field.nodes - 2;
  return {below, place - static_cast<float>(below)};
}

POINTFAIR_INLINE float between(float from, float to, float share) { return from + share * (to - from); }

// Trilinear. A translation that leaves all differences of coordinates exact changes no bit.
POINTFAIR_INLINE float node_value(const NodeField& field, Vec3<float> p) {
  if (field.values == nullptr) return 1.0f;
  const NodePlace x = node_place(field, p.x, field.first.x), y = node_place(field, p.y, field.first.y),
                  z = node_place(field, p.z, field.first.z);
  const float* const corner = field.values + (z.below * field.nodes + y.below) * field.nodes + x.below;
  float face[2];
  for (int k = 0; k < 2; ++k) {
    const float* const low = corner + k * field.nodes * field.nodes;
    const float* const high = low + field.nodes;
    face[k] = between(between(low[0], low[1], x.above), between(high[0], high[1], x.above), y.above);
  }
  return between(face[0], face[1], z.above);
}

}  // namespace pointfair::point
