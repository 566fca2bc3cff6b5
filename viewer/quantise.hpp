// SPDX-License-Identifier: Apache-2.0
// Displacements and normals as they travel. A displacement is 2 bytes, a number of steps along the point's normal, or
// 6 bytes, steps along x, y and z. A step is a 128th of the spacing, so rounding costs less than a 145th of the
// spacing; every point is decoded again while it is encoded, and one that is off by more travels as an exception of 16
// bytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "order.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// The step for a cloud of this spacing and diagonal, in file units. More than 0.
float displacement_step(double spacing, double diagonal);

/// What the page may be off by at most, in steps: a hundredth of the spacing is 1.28.
inline constexpr float kTolerance = 1.25f;

/// A unit normal as two numbers of an octahedron's unfolding (Cigolle 2014), 16 bits each; (0, 0, 0) is kNoNormal.
/// Off by less than 1e-4 rad.
struct OctNormal {
  std::int16_t u, v;
};
inline constexpr OctNormal kNoNormal{-32768, -32768};
OctNormal encode_normal(const Point& normal);
Point decode_normal(OctNormal normal);

/// The normals of the places [0, count) of the order, as pairs u, v.
std::vector<std::int16_t> encode_normals(std::span<const Point> normals, const Order& order, std::size_t count);

struct Displacements {
  bool along_normals = false;         ///< one value a point, else three
  std::vector<std::int16_t> values;   ///< in steps
  std::vector<std::uint32_t> places;  ///< of the exceptions, ascending; their values count as 0
  std::vector<float> exceptions;      ///< x, y, z of each
  double mean = 0, rms = 0, max = 0;  ///< of the lengths of finite displacements, file units
  double p95 = 0;                     ///< of those of the first 4,096 places, which are spread over the file
};

/// The displacements of the places [0, count) of the order: `after` and `before` are in file order, `normals` holds the
/// pairs that the page has, or is empty. Along the normals where nearly all motion is along them.
Displacements encode_displacements(std::span<const Point> before, std::span<const Point> after, const Order& order,
                                   std::size_t count, std::span<const std::int16_t> normals, float step);

}  // namespace pointfair::viewer
