// SPDX-License-Identifier: Apache-2.0
// The order in which sums over radius neighbourhoods run: along a Hilbert curve of 2^20 steps an axis, in one cell of
// it by position (lies_before). A pure function of the set of positions and of one cube, so that it is the same on
// every device and whatever the order of the points, and a tile of a cloud keeps the order of the whole.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// The cube holds most points, its edges parallel to the axes. From a reference point a fifth of the side lies below,
// four fifths above. Coordinates are only used as differences from the reference point.
struct CurveCube {
  float x, y, z;  // the reference point
  float inverse_side;
};
inline constexpr float kBelowReference = 0.2f;

POINTFAIR_INLINE CurveCube curve_cube(Vec3<float> reference, float side) {
  const float inverse = side > 0 ? 1.0f / side : 0.0f;
  return {reference.x, reference.y, reference.z, inverse < 3e38f ? inverse : 0.0f};
}

// A position on the curve has two digits, each a Hilbert curve of kDigitBits bits an axis: the first over all, the
// second within a cell of the first.
inline constexpr int kDigitBits = 10;
inline constexpr float kCurveSteps = 1 << (2 * kDigitBits);

// Where a coordinate lies on its axis of the curve, in steps, below kCurveSteps. The cube has 7/8 of the steps; what
// lies beyond it shares the rest, the fewer the farther away, so that stray points neither stretch the curve nor fall
// together.
template <class F>
POINTFAIR_INLINE F curve_step(F coordinate, float reference, float inverse_side) {
  constexpr float kMargin = kCurveSteps / 16;
  const F u = (coordinate - reference) * inverse_side + kBelowReference;
  const F beyond = F(kMargin) / larger(F(1.0f), larger(u, 1.0f - u));  // 1 - u below the cube, u above it
  const F inside = u * (kCurveSteps - 2 * kMargin) + kMargin;
  const F step = select(u < F{}, beyond, select(u > F(1.0f), kCurveSteps - beyond, inside));
  return smaller(step, F(kCurveSteps - 1));
}

}  // namespace pointfair::point
