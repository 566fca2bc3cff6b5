// SPDX-License-Identifier: Apache-2.0
// The noise of a cloud from place to place, and how much of a displacement it justifies.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// Levels of noise at the nodes of a cubic grid: the local standard deviation over that of a typical place.
inline constexpr int kFieldNodes = 32;  // along each axis
struct NoiseField {
  const float* levels;   // [z][y][x], kFieldNodes of each; null: 1 everywhere
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
POINTFAIR_INLINE float noise_level(const NoiseField& field, Vec3<float> p) {
  if (field.levels == nullptr) return 1.0f;
  const NodePlace x = node_place(p.x, field.first.x, field.nodes_per_unit),
                  y = node_place(p.y, field.first.y, field.nodes_per_unit),
                  z = node_place(p.z, field.first.z, field.nodes_per_unit);
  const float* const corner = field.levels + (z.below * kFieldNodes + y.below) * kFieldNodes + x.below;
  float face[2];
  for (int k = 0; k < 2; ++k) {
    const float* const low = corner + k * kFieldNodes * kFieldNodes;
    const float* const high = low + kFieldNodes;
    face[k] = between(between(low[0], low[1], x.above), between(high[0], high[1], x.above), y.above);
  }
  return between(face[0], face[1], z.above);
}

// The variance of the heights of a point's neighbours over its plane.
template <class F>
struct HeightSpread {
  F count{}, sum{}, squares{};

  template <class Mask>
  POINTFAIR_INLINE void add(F height, Mask inside) {
    count = count + select(inside, F(1.0f), F{});
    sum = sum + select(inside, height, F{});
    squares = squares + select(inside, height * height, F{});
  }
  // 0 without neighbours
  POINTFAIR_INLINE F variance() const {
    const F inverse = select(count > F{}, F(1.0f) / count, F{});
    const F mean = sum * inverse;
    return larger(squares * inverse - mean * mean, F{});
  }
};

// Up to kChance of the noise's variance may be missing or too much by chance; after the first iteration kNoiseLeft of
// it is left.
inline constexpr float kChance = 0.3f, kNoiseLeft = 0.1f;

// The share of a displacement that noise justifies, as a local Wiener filter has it: noise / (noise + damage x shape).
// `variance`: of the heights; `noise`: the variance of the noise before the first iteration; `left`: how much of it the
// heights still hold, 1 in the first iteration and kNoiseLeft in later ones; `damage`: what the step does to a shape,
// in its variance within the neighbourhood.
template <class F>
POINTFAIR_INLINE F noise_share(F variance, F noise, float left, float damage) {
  const F shape = larger(variance - noise * (left + kChance), F{});
  const F whole = noise + shape * damage;
  return select(whole > F{}, noise / whole, F{});
}
}  // namespace pointfair::point
