// SPDX-License-Identifier: Apache-2.0
// The order in which sums over balls run: along a Hilbert curve of 2^20 steps an axis, in one cell of it by position
// (lies_before, src/point/neighbors.h). A pure function of the set of positions and of one cube, so that it is the same
// on every device and whatever the order of the points, and a part of a cloud keeps the order of the whole.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// The cube holds most points. Its edges are axes-parallel; `inverse_side` is 0 for a cloud without extent.
struct CurveCube {
  float x, y, z;  // its lower corner
  float inverse_side;
};

POINTFAIR_INLINE CurveCube curve_cube(Vec3<float> origin, float side) {
  const float inverse = side > 0 ? 1.0f / side : 0.0f;
  return {origin.x, origin.y, origin.z, inverse < 3e38f ? inverse : 0.0f};
}

// A position on the curve has two digits, each a Hilbert curve of kDigitBits bits an axis: the first over all, the
// second within a cell of the first.
inline constexpr int kDigitBits = 10;
inline constexpr float kCurveSteps = 1 << (2 * kDigitBits);

// Where a coordinate lies on its axis of the curve, in steps, below kCurveSteps. The cube has 7/8 of the steps; what
// lies beyond it shares the rest, the fewer the farther away, so that stray points neither stretch the curve nor fall
// together.
template <class F>
POINTFAIR_INLINE F curve_step(F coordinate, float origin, float inverse_side) {
  constexpr float kMargin = kCurveSteps / 16;
  const F u = (coordinate - origin) * inverse_side;
  const F beyond = F(kMargin) / larger(F(1.0f), larger(u, 1.0f - u));  // 1 - u below the cube, u above it
  const F inside = u * (kCurveSteps - 2 * kMargin) + kMargin;
  const F step = select(u < F{}, beyond, select(u > F(1.0f), kCurveSteps - beyond, inside));
  return smaller(step, F(kCurveSteps - 1));
}

}  // namespace pointfair::point
